from __future__ import annotations

import re
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import msgspec
import numpy as np
import pytest

from common.cell import RobotConfig
from common.errors import RobotError
from common.robot import geometry
from common.robot.model import load_robot
from tests.support.arms import PLANAR_URDF, planar_config
from tests.support.cell import ur3_cell
from tests.support.eventually import eventually


def test_any_serial_arm_from_a_path(tmp_path: Path):
    robot = load_robot(planar_config(tmp_path))
    assert robot.n_joints == 2
    assert [body.name for body in robot.bodies] == ["base", "upper", "lower"]
    tip = robot.tool_pose(np.array([np.pi / 2, 0.0]))
    assert tip[:3, 3] == pytest.approx([0.0, 0.55, 0.1], abs=1e-12)


def test_the_second_load_comes_from_the_cache_and_is_equal(tmp_path: Path):
    first, second = load_robot(planar_config(tmp_path)), load_robot(planar_config(tmp_path))
    assert first.fingerprint == second.fingerprint
    for a, b in zip(first.grids, second.grids, strict=True):
        assert np.array_equal(a, b)


def test_a_torn_cache_is_made_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    first = load_robot(planar_config(tmp_path))
    (kept,) = (tmp_path / "cache" / "tolman").glob("geometry-*.npz")
    kept.write_bytes(kept.read_bytes()[:1000])
    again = load_robot(planar_config(tmp_path))
    assert np.array_equal(first.grids.distance, again.grids.distance)


def test_an_arm_that_stands_elsewhere_slower_or_with_another_home_is_of_the_same_geometry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    config = planar_config(tmp_path)
    first = load_robot(config)
    monkeypatch.setattr(geometry, "_compute", None)
    moved = msgspec.structs.replace(config, base_position_m=[0.1, 0.2, 0.3], base_rpy_rad=[0.0, 0.0, 1.0], home_rad=[0.1, 0.1])
    again = load_robot(moved)
    assert again.fingerprint != first.fingerprint
    assert np.array_equal(first.grids.distance, again.grids.distance) and np.array_equal(first.pairs, again.pairs)
    with pytest.raises(TypeError):  # None is no function: other limits are asked for anew
        load_robot(msgspec.structs.replace(config, position_max_rad=[1.0, 1.0]))


def test_of_two_that_start_side_by_side_one_makes_the_geometry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    config = planar_config(tmp_path)
    compute, read, began, reads, go_on = geometry._compute, geometry._read, [], [], threading.Event()

    def slowly(*arguments):
        began.append(threading.get_ident())
        go_on.wait(30.0)
        return compute(*arguments)

    monkeypatch.setattr(geometry, "_compute", slowly)
    monkeypatch.setattr(geometry, "_read", lambda path: reads.append(path) or read(path))
    with ThreadPoolExecutor(2) as pool:
        loads = [pool.submit(load_robot, config) for _ in range(2)]
        eventually(lambda: began and len(reads) == 3, what="one look of both and one more, behind the lock")
        go_on.set()
        one, other = (load.result() for load in loads)
    assert len(began) == 1
    assert np.array_equal(one.grids.distance, other.grids.distance)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"urdf": "/nowhere/arm.urdf"}, "no such file: /nowhere/arm.urdf"),
        ({"urdf": "example-robot-data:ur_description/urdf/ur33.urdf"}, "no such file"),
        ({"flange_frame": "hand"}, "no frame 'hand'"),
        ({"flange_frame": "forearm_link"}, "does not move with the last joint"),
        ({"immobile_links": ["pedestal"]}, "pedestal"),
        ({"position_min_rad": [4.0] * 6}, "limits are empty"),
        ({"home_rad": [9.0] * 6}, "home_rad: shoulder_pan_joint"),
        ({"locked_joints": {"thumb": 0.0}}, "unknown joints ['thumb']"),
    ],
)
def test_errors_name_place_and_value(change, words):
    with pytest.raises(RobotError) as caught:
        load_robot(msgspec.structs.replace(ur3_cell().robot, **change))
    assert words in caught.value.message


def test_a_branching_arm_is_refused_with_the_way_out(tmp_path: Path):
    finger = """<joint name="finger" type="revolute"><parent link="upper"/><child link="thumb"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" velocity="1" effort="1"/></joint><link name="thumb"/></robot>"""
    config = planar_config(tmp_path)
    Path(config.urdf).write_text(PLANAR_URDF.replace("</robot>", finger), encoding="utf-8")
    with pytest.raises(RobotError, match="locked_joints"):
        load_robot(config)
    locked = load_robot(msgspec.structs.replace(config, locked_joints={"finger": 0.2}))
    assert locked.n_joints == 2


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("<collision>.*?</collision>", "", "no moving link has collision geometry"),
        ('type="revolute"', 'type="fixed"', "has no moving joint"),
        ("<box[^>]*>", '<mesh filename="package://nowhere/part.stl"/>', "part.stl"),
        ('velocity="2"', 'velocity="0"', "max_velocity_rad_s"),
    ],
)
def test_a_urdf_that_cannot_be_used_says_why(tmp_path: Path, old: str, new: str, words: str):
    config = planar_config(tmp_path)
    Path(config.urdf).write_text(re.sub(old, new, PLANAR_URDF), encoding="utf-8")
    with pytest.raises(RobotError, match=words):
        load_robot(msgspec.structs.replace(config, immobile_links=[]))


def test_a_joint_without_end_gets_a_turn_either_way_and_a_config_may_narrow_it(tmp_path: Path):
    config = planar_config(tmp_path)
    endless = PLANAR_URDF.replace('name="elbow" type="revolute"', 'name="elbow" type="continuous"')
    plain = load_robot(config)
    Path(config.urdf).write_text(endless, encoding="utf-8")
    robot = load_robot(config)
    assert robot.n_joints == 2
    assert robot.position_min_rad[1] == pytest.approx(-2 * np.pi) and robot.position_max_rad[1] == pytest.approx(2 * np.pi)
    assert robot.position_min_rad[0] == plain.position_min_rad[0]
    assert robot.max_velocity_rad_s.tolist() == plain.max_velocity_rad_s.tolist()
    q = np.array([0.3, -0.7])
    np.testing.assert_allclose(robot.tool_pose(q), plain.tool_pose(q), atol=1e-12)
    narrow = load_robot(msgspec.structs.replace(config, position_min_rad=[-1.0, -1.5], position_max_rad=[1.0, 1.5]))
    assert narrow.position_max_rad.tolist() == [1.0, 1.5]
    locked = load_robot(msgspec.structs.replace(config, locked_joints={"elbow": 0.4}, home_rad=[0.0], max_acceleration_rad_s2=[1.0]))
    np.testing.assert_allclose(locked.tool_pose(np.array([0.3])), plain.tool_pose(np.array([0.3, 0.4])), atol=1e-12)


def test_a_joint_without_end_and_without_speed_takes_the_configs(tmp_path: Path):
    config = planar_config(tmp_path)
    before, after = PLANAR_URDF.split('name="elbow" type="revolute"')
    bare = f'{before}name="elbow" type="continuous"{re.sub("<limit[^>]*>", "", after)}'
    Path(config.urdf).write_text(bare, encoding="utf-8")
    with pytest.raises(RobotError, match=r"max_velocity_rad_s.*state them"):
        load_robot(config)
    assert load_robot(msgspec.structs.replace(config, max_velocity_rad_s=[9.0, 1.5])).max_velocity_rad_s.tolist() == [2.0, 1.5]


def test_a_urdf_is_read_in_the_encoding_that_it_names(tmp_path: Path):
    config = planar_config(tmp_path)
    plain = load_robot(config)
    named = PLANAR_URDF.replace('version="1.0"', 'version="1.0" encoding="iso-8859-1"').replace("<robot", "<!-- für zwei Gelenke --><robot")
    Path(config.urdf).write_bytes(named.encode("iso-8859-1"))
    assert load_robot(config).joint_names == plain.joint_names


def test_a_home_of_another_arm_is_refused(tmp_path: Path):
    with pytest.raises(RobotError, match=r"home_rad has 3 values, planar.urdf has 2 joints"):
        load_robot(msgspec.structs.replace(planar_config(tmp_path), home_rad=[0.0, 0.0, 0.0]))


def test_a_sliding_joint_slides(tmp_path: Path):
    config = planar_config(tmp_path)
    rail = PLANAR_URDF.replace('name="shoulder" type="revolute"', 'name="shoulder" type="prismatic"')
    Path(config.urdf).write_text(rail, encoding="utf-8")
    robot = load_robot(config)
    assert robot.chain.prismatic.tolist() == [1, 0]
    tip = robot.tool_pose(np.array([0.2, np.pi / 2]))
    assert tip[:3, 3] == pytest.approx([0.3, 0.25, 0.3], abs=1e-12)


def test_something_that_is_no_urdf(tmp_path: Path):
    path = tmp_path / "arm.urdf"
    path.write_text("<robot", encoding="utf-8")
    config = RobotConfig(name="x", urdf=str(path), flange_frame="f", home_rad=[0.0], max_acceleration_rad_s2=[1.0])
    with pytest.raises(RobotError):
        load_robot(config)
