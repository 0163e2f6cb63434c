"""The physics world against the robot model, analytic distances, and the protocol's terms."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from common.cell import SolidConfig
from common.robot.payload import Payload, with_payload_shape
from services.robot_sim.adapters.bullet import World
from services.robot_sim.adapters.bullet_monitor import Monitor
from services.robot_sim.adapters.convex import convex_pieces
from services.robot_sim.config import RobotSimConfig
from services.robot_sim.core.obstacles import Thing, pose_of
from tests.support.cell import ur3, ur3_cell

STEP_S = 0.004
# Stretched out over the table, gripper forward: nothing of the arm is near anything.
FORWARD = np.array([0.0, -1.2, 0.6, -1.0, -1.5708, 0.0])


@pytest.fixture
def world() -> Iterator[World]:
    with World(ur3(), ur3_cell().static, STEP_S) as made:
        yield made


def thing(id: str, shape: str, size_m: tuple[float, ...], position_m: list[float]) -> Thing:
    return Thing(id, shape, size_m, pose_of(position_m, None, "test"), np.zeros(3))  # type: ignore[arg-type]


def drive(world: World, q_from: np.ndarray, q_to: np.ndarray, seconds: float, each=lambda q, dq_reference: None) -> None:
    """Cosine from rest to rest."""
    n = round(seconds / STEP_S)
    shares = 0.5 - 0.5 * np.cos(np.pi * np.arange(n + 1) / n)
    for a, b in pairwise(shares):
        world.step(q_from + a * (q_to - q_from), q_from + b * (q_to - q_from))
        each(world.joints()[0], (b - a) / STEP_S * (q_to - q_from))


@pytest.mark.parametrize("seed", range(5))
def test_link_frames_are_the_models(world: World, seed: int) -> None:
    robot = ur3()
    q = np.random.default_rng(seed).uniform(robot.position_min_rad, robot.position_max_rad)
    world.reset(q)
    assert np.abs(world.frame_poses() - robot.joint_poses(q[None])[0, 1:]).max() < 1e-6
    assert np.allclose(world.joints()[0], q)


def test_the_arm_follows_its_reference_at_full_speed(world: World) -> None:
    robot = ur3()
    q_to = robot.home_rad + np.array([1.5, 0.6, -0.9, 1.0, 1.5, 1.5])
    seconds = float(np.sqrt(np.pi**2 / 2 * np.abs(q_to - robot.home_rad) / robot.max_acceleration_rad_s2).max())
    n = [0]
    worst = [0.0]

    def look(q: np.ndarray, _dq: np.ndarray) -> None:
        n[0] += 1
        reference = robot.home_rad + (0.5 - 0.5 * np.cos(np.pi * n[0] / round(seconds / STEP_S))) * (q_to - robot.home_rad)
        worst[0] = max(worst[0], float(np.abs(q - reference).max()))

    drive(world, robot.home_rad, q_to, seconds, look)
    assert worst[0] < 1e-3


def test_distance_to_a_sphere_is_that_of_the_meshes(world: World) -> None:
    """The nearest vertex of all body meshes, the slow twin; the convex pieces may fill hollows by millimetres."""
    robot = ur3()
    poses = robot.joint_poses(robot.home_rad[None])[0]
    points = np.vstack([b.vertices @ poses[b.joint][:3, :3].T + poses[b.joint][:3, 3] for b in robot.bodies])
    for i, position in enumerate(([0.35, 0.3, 0.3], [0.5, -0.1, 0.2], [-0.2, -0.1, 0.5])):
        world.add(thing(f"ball{i}", "sphere", (0.05,), position))
        nearest = world.nearest_obstacle(3.0)
        assert nearest is not None
        expected = np.linalg.norm(points - position, axis=1).min() - 0.05
        assert expected - 0.015 < nearest.distance_m < expected + 0.003
        world.remove(f"ball{i}")
    assert world.nearest_obstacle(3.0) is None


def test_distances_of_the_tool_are_exact(world: World) -> None:
    """Under the gripper at home there is the table: the gripper's corner is what comes lowest."""
    robot = ur3()
    tool = next(b for b in robot.bodies if b.name == "tool")
    T = robot.joint_poses(robot.home_rad[None])[0, -1]
    lowest = (tool.vertices @ T[:3, :3].T + T[:3, 3])[:, 2].min()
    world.add(thing("plate", "box", (0.2, 0.2, 0.02), [T[0, 3], T[1, 3], lowest - 0.04]))
    nearest = world.nearest_obstacle(0.05)
    assert nearest is not None
    assert (nearest.part, nearest.other) == ("tool", "plate")
    assert nearest.distance_m == pytest.approx(0.03 - 0.001, abs=1e-4)  # the engine's margin


def test_the_base_on_the_table_counts_for_nothing(world: World) -> None:
    assert world.nearest_static(0.01) is None
    for _ in range(5):
        world.step(ur3().home_rad, ur3().home_rad)
    assert world.touches(*world.joints()) == []


def monitored(world: World) -> Monitor:
    return Monitor(world, RobotSimConfig())


def test_driving_into_a_box_is_caused(world: World) -> None:
    start, end = FORWARD, FORWARD + np.array([1.0, 0, 0, 0, 0, 0])
    world.reset(start)
    tool = ur3().tool_pose(FORWARD + np.array([0.5, 0, 0, 0, 0, 0]))[:3, 3]
    world.add(thing("box", "box", (0.08, 0.08, 0.08), tool.tolist()))
    monitor = monitored(world)
    now = [0]

    def look(q: np.ndarray, dq: np.ndarray) -> None:
        now[0] += 4_000_000
        monitor.after_cycle(now[0], q, q, dq)

    drive(world, start, end, 3.0, look)
    assert (monitor.contacts.caused, monitor.contacts.suffered) == (1, 0)
    assert all(other == "box" for _, other in monitor.contacts.pairs)
    assert monitor.min_obstacle_m is not None and monitor.min_obstacle_m < 0.005


def test_being_hit_while_standing_is_suffered(world: World) -> None:
    world.reset(FORWARD)
    tool = ur3().tool_pose(FORWARD)[:3, 3]
    world.add(thing("hand", "sphere", (0.04,), (tool + np.array([0.0, 0.3, 0.0])).tolist()))
    monitor = monitored(world)
    for k in range(240):
        world.place("hand", pose_of((tool + np.array([0.0, 0.3 - 0.001 * k, 0.0])).tolist(), None, "test"))
        world.step(FORWARD, FORWARD)
        monitor.after_cycle(k * 4_000_000, world.joints()[0], FORWARD, np.zeros(6))
    assert (monitor.contacts.caused, monitor.contacts.suffered) == (0, 1)


def test_pressing_on_the_table_and_folding_into_itself_are_caused(world: World) -> None:
    for end, others in (
        (np.array([0.0, 0.35, 0.4, -1.5, -1.5708, 0.0]), {"table"}),
        (np.array([0.0, -1.5708, 2.95, -1.5708, -1.5708, 0.0]), {body.name for body in ur3().bodies}),
    ):
        world.reset(FORWARD)
        monitor = monitored(world)
        now = [0]

        def look(q: np.ndarray, dq: np.ndarray, monitor: Monitor = monitor, now: list[int] = now) -> None:
            now[0] += 4_000_000
            monitor.after_cycle(now[0], q, q, dq)

        drive(world, FORWARD, end, 2.0, look)
        assert monitor.contacts.caused >= 1 and monitor.contacts.suffered == 0, end
        assert {other for _, other in monitor.contacts.pairs} <= others, monitor.contacts.pairs


def test_pieces_hold_the_body_and_little_more() -> None:
    for body in ur3().bodies:
        a, b, c = (body.vertices[body.triangles[:, k]] for k in range(3))
        mesh = float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum()) / 6.0
        pieces = sum(ConvexHull(piece).volume for piece in convex_pieces(body))
        assert 0.96 * mesh < pieces < (1.55 if body.immobile else 1.25) * mesh, body.name


def test_two_worlds_share_nothing_and_leave_no_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    box = [SolidConfig(name="box", shape="box", size_m=[0.1, 0.1, 0.1], position_m=[1.0, 0.0, 0.5])]
    with World(ur3(), box, STEP_S) as one, World(ur3(), [], STEP_S) as other:
        one.reset(FORWARD)
        assert not np.allclose(one.joints()[0], other.joints()[0])
        assert one.nearest_static(3.0) is not None and other.nearest_static(3.0) is None
    one.close()  # again: no harm
    assert list(tmp_path.iterdir()) == []


def test_an_arm_that_holds_a_box_has_it_as_a_body(world: World) -> None:
    bare = ur3()
    held = with_payload_shape(bare, Payload((0.04, 0.04, 0.10), (0.0, 0.0, 0.05)))
    tool = bare.tool_pose(FORWARD)
    below = tool[:3, 3] + 0.17 * tool[:3, 2]  # the box ends 0.10 m beyond the tool's centre, the ball begins 0.15 m beyond
    world.add(thing("ball", "sphere", (0.02,), below.tolist()))
    seen = []
    for robot in (bare, held, bare):
        world.change_arm(robot, FORWARD)
        assert np.allclose(world.joints()[0], FORWARD)
        assert np.abs(world.frame_poses() - bare.joint_poses(FORWARD[None])[0, 1:]).max() < 1e-6
        nearest = world.nearest_obstacle(0.5)
        assert nearest is not None
        seen.append((nearest.part, round(nearest.distance_m, 2)))
    assert seen == [("tool", 0.15), ("payload", 0.05), ("tool", 0.15)]
    world.change_arm(held, FORWARD)
    drive(world, FORWARD, FORWARD + 0.2, 0.5)
    assert np.allclose(world.joints()[0], FORWARD + 0.2, atol=0.01)
