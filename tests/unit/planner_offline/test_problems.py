"""Problems from a file: what is read, and how malformed files are refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from common.errors import ConfigError
from services.planner.offline.problems import read_problems

JOINTS = ("a", "b", "c")
AT_ORIGIN = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def box(**other: Any) -> dict[str, Any]:
    return {"id": "shelf", "shape": "box", "extents": [0.2, 0.4, 0.6], "position_m": [1, 2, 3], "quaternion_xyzw": [0, 0, 0, 1], **other}


def problem(**other: Any) -> dict[str, Any]:
    return {"index": 7, "start_rad": [0.1, 0.2, 0.3], "goal_rad": [0.4, 0.5, 0.6], "obstacles": [box()], **other}


def write(folder: Path, *records: Any, joints: list[str] | None = None, **meta: Any) -> Path:
    path = folder / "problems.json"
    data = {"meta": {"joints": joints or list(JOINTS), **meta}, "problems": {"kitchen": list(records)}}
    path.write_text(json.dumps(data), encoding="utf-8")
    return path


def test_ends_come_in_the_robots_order_of_joints(tmp_path: Path) -> None:
    (read,) = read_problems(write(tmp_path, problem(), joints=["c", "a", "b"]), JOINTS, AT_ORIGIN)
    assert (read.set_name, read.index, read.name) == ("kitchen", 7, "kitchen 7")
    assert read.q_start.tolist() == [0.2, 0.3, 0.1] and read.q_goal.tolist() == [0.5, 0.6, 0.4]


def test_poses_are_in_the_frame_of_the_base(tmp_path: Path) -> None:
    (read,) = read_problems(write(tmp_path, problem()), JOINTS, ((0.0, 0.0, 1.0), (0.0, 0.0, np.pi / 2)))
    (solid,) = read.solids
    assert np.allclose(solid.position_m, [-2, 1, 4]) and np.allclose(solid.rpy_rad, [0, 0, np.pi / 2]) and solid.size_m == [0.2, 0.4, 0.6]


def test_all_shapes_and_numbers_without_index(tmp_path: Path) -> None:
    can = {"id": "can", "shape": "cylinder", "radius": 0.03, "height": 0.12, "position_m": [0, 0, 0], "quaternion_xyzw": [0, 0, 0, 1]}
    ball = {"id": "ball", "shape": "sphere", "radius": 0.05, "position_m": [0, 0, 0], "quaternion_xyzw": [0, 0, 0, 1]}
    records = [{key: value for key, value in problem(obstacles=[can, ball]).items() if key != "index"} for _ in range(2)]
    read = read_problems(write(tmp_path, *records, note="meta may say more"), JOINTS, AT_ORIGIN)
    assert [p.index for p in read] == [1, 2]
    assert [(s.shape, s.size_m) for s in read[0].solids] == [("cylinder", [0.03, 0.12]), ("sphere", [0.05])]


@pytest.mark.parametrize(
    ("record", "says"),
    [
        (problem(start_rad=[0.1, 0.2]), ["set kitchen, problem 7", "start_rad", "2 values", "3 joints"]),
        (problem(goal_rad=[0.1, float("nan"), 0.3]), ["problem 7", "goal_rad[1]", "finite"]),
        (problem(goal_rad="home"), ["problem 7", "goal_rad"]),
        ({"index": 7, "start_rad": [0, 0, 0], "obstacles": []}, ["problem 7", "goal_rad"]),
        (problem(obstacles=[box(shape="teapot")]), ["problem 7", "obstacles[0]", "shape", "teapot"]),
        (problem(obstacles=[box(), box(extents=[0.1, -0.2, 0.3])]), ["obstacles[1]", "extents"]),
        (problem(obstacles=[box(extents=[0.1, 0.2])]), ["obstacles[0]", "extents"]),
        (problem(obstacles=[box(quaternion_xyzw=[0, 0, 0, 0])]), ["shelf", "quaternion_xyzw", "length 0"]),
        (problem(obstacles=[box(position_m=[0, float("inf"), 0])]), ["shelf", "finite"]),
        (problem(obstacles=[box(shape="cylinder", radius=0.1)]), ["shelf", "cylinder", "extents"]),
        (problem(obstacles=[box(colour="red")]), ["obstacles[0]", "colour"]),
        (["no", "object"], ["set kitchen, problem 1", "object"]),
    ],
)
def test_a_malformed_problem_is_refused_with_set_problem_and_field(tmp_path: Path, record: Any, says: list[str]) -> None:
    path = write(tmp_path, record)
    with pytest.raises(ConfigError) as refused:
        read_problems(path, JOINTS, AT_ORIGIN)
    assert refused.value.code == "bad_problems"
    for word in [str(path), *says]:
        assert word in refused.value.message


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("{", "not JSON"),
        ("[]", "meta and problems"),
        ("{}", "meta"),
        ('{"meta": {"joints": ["a", "b", "x"]}, "problems": {"s": []}}', "meta.joints"),
        ('{"meta": {"joints": ["a", "b", "c"], "units": "mm, deg"}, "problems": {"s": []}}', "meta.units"),
        ('{"meta": {"joints": ["a", "b", "c"]}}', "problems"),
        ('{"meta": {"joints": ["a", "b", "c"]}, "problems": {"s": []}}', "set s"),
    ],
)
def test_a_malformed_file_is_refused(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "problems.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=says):
        read_problems(path, JOINTS, AT_ORIGIN)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be read"):
        read_problems(tmp_path / "none.json", JOINTS, AT_ORIGIN)
