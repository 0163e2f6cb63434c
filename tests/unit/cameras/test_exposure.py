"""What the world looked like between two samples, and when it is looked at."""

from __future__ import annotations

import numpy as np
import pytest

from common.robot.history import JointHistory, JointSample
from services.robot_sim.core.camera_exposure import MovingShape, SceneHistory, moving_shape
from services.robot_sim.core.camera_schedule import Schedule

MS = 1_000_000


def sphere(x: float, vx: float = 0.0) -> MovingShape:
    shape = moving_shape("sphere", [0.1], [x, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0], [vx, 0.0, 0.0])
    assert isinstance(shape, MovingShape)
    return shape


def x_at(history: SceneHistory, stamp_ns: int) -> float:
    shapes = history.at(stamp_ns)
    assert shapes is not None
    return float(shapes[0].T_world_shape[0, 3])


def test_obstacles_are_carried_on_by_their_velocity() -> None:
    history = SceneHistory(max_extrapolation_s=0.1)
    assert history.at(0) is None
    history.add(100 * MS, [sphere(1.0, 0.25)])
    assert x_at(history, 120 * MS) == pytest.approx(1.005)
    assert x_at(history, 100 * MS + 10**10) == pytest.approx(1.025)  # its publisher stopped: not carried on for ever


def test_an_exposure_takes_the_scene_before_it_not_the_one_after() -> None:
    history = SceneHistory(max_extrapolation_s=0.1)
    history.add(100 * MS, [sphere(1.0, 0.25)])
    history.add(133 * MS, [sphere(2.0)])
    assert x_at(history, 132 * MS) == pytest.approx(1.008)
    assert x_at(history, 133 * MS) == 2.0
    history.add(10 * MS, [sphere(3.0)])  # the simulation began anew
    assert x_at(history, 500 * MS) == 3.0


@pytest.mark.parametrize(
    ("shape", "size", "position", "quaternion"),
    [
        ("mesh", [1.0], [0, 0, 0], [0, 0, 0, 1]),
        ("box", [1.0], [0, 0, 0], [0, 0, 0, 1]),
        ("sphere", [-1.0], [0, 0, 0], [0, 0, 0, 1]),
        ("sphere", [1.0], [0, float("nan"), 0], [0, 0, 0, 1]),
        ("sphere", [1.0], [0, 0], [0, 0, 0, 1]),
        ("sphere", [1.0], [0, 0, 0], [0, 0, 0, 0]),
    ],
)
def test_what_cannot_be_drawn_is_named(shape: str, size: list[float], position: list[float], quaternion: list[float]) -> None:
    assert isinstance(moving_shape(shape, size, position, quaternion, [0, 0, 0]), str)


def sample(stamp_ns: int, q: float, dq: float = 0.0, seq: int = 0) -> JointSample:
    return JointSample(stamp_ns, np.array([q]), np.array([dq]), seq)


def test_joints_are_interpolated_and_barely_extrapolated() -> None:
    history = JointHistory(1)
    assert history.at(0) is None
    for i in range(3):
        assert history.add(sample(i * 8 * MS, 0.1 * i, 12.5, seq=i)) is None
    middle = history.at(12 * MS)
    assert middle is not None
    assert middle.q_rad[0] == pytest.approx(0.15)
    assert middle.seq == 2
    beyond = history.at(20 * MS)
    assert beyond is not None
    assert beyond.q_rad[0] == pytest.approx(0.25)
    assert history.at(50 * MS) is None
    assert history.at(-1) is None


def test_a_gap_in_the_joint_samples_is_not_bridged() -> None:
    history = JointHistory(1)
    history.add(sample(0, 0.0))
    history.add(sample(500 * MS, 1.0))
    assert history.at(250 * MS) is None
    assert history.at(500 * MS) is not None


def test_an_arm_that_was_put_elsewhere_is_nowhere_between() -> None:
    history = JointHistory(2)
    for i, q in enumerate(([0.0, 0.0], [0.0, 0.1], [1.0, 0.1], [1.0, 0.2])):
        history.add(JointSample(i * 8 * MS, np.array(q), np.zeros(2), i))
    assert history.at(4 * MS) is not None and history.at(20 * MS) is not None
    assert history.at(12 * MS) is None
    at_both = [history.at(8 * MS), history.at(16 * MS)]
    assert [sample is not None and sample.q_rad[0] for sample in at_both] == [0.0, 1.0]


def test_broken_joint_samples_are_refused_and_a_restart_forgets() -> None:
    history = JointHistory(1)
    assert "finite" in (history.add(sample(0, float("nan"))) or "")
    assert "shape" in (history.add(JointSample(0, np.zeros(2), np.zeros(2), 0)) or "")
    history.add(sample(100 * MS, 1.0))
    history.add(sample(10 * MS, 2.0))
    assert history.at(100 * MS) is None
    assert history.newest_ns == 10 * MS


def test_the_shutter_keeps_its_grid_and_skips_what_it_missed() -> None:
    schedule = Schedule(10.0, 0.010)
    assert schedule.due(1_000 * MS) is None
    assert schedule.next_due_ns == 1_010 * MS
    assert schedule.due(1_010 * MS) == (1_000 * MS, 0)
    assert schedule.due(1_011 * MS) is None
    assert schedule.due(1_320 * MS) == (1_300 * MS, 3)
    assert schedule.n_skipped == 2
    assert schedule.next_due_ns == 1_410 * MS
