from __future__ import annotations

import numpy as np
import pytest

from common.robot import braking
from common.robot.braking import brake_along
from common.robot.curves import cut, join
from common.robot.trajectory import JointTrajectory
from services.robot_sim.core.limits import violation
from tests.support.robot_sim_curves import LIMITS, straight, swing
from tests.support.slow_braking import slow_slow_down


def a_path(seed: int) -> JointTrajectory:
    rng = np.random.default_rng(seed)
    first = straight(rng.uniform(-1.5, 1.5, 2), rng.uniform(-1.5, 1.5, 2))
    at = rng.uniform(0.2, 0.8) * first.duration_s
    q, dq, _ = first.sample(at)
    return join([cut(first, 0.0, at), swing(q, dq, q + 0.5 * dq + rng.uniform(-0.3, 0.3, 2))])


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("share", [0.1, 0.35, 0.6, 0.95])
def test_stays_on_the_path_keeps_the_limits_and_ends_at_rest(seed: int, share: float) -> None:
    whole = a_path(seed)
    assert violation(whole, LIMITS, 1e-9) is None
    path = cut(whole, share * whole.duration_s, whole.duration_s)
    brake = brake_along(path, LIMITS.max_acceleration_rad_s2)
    assert np.array_equal(brake.curve.q_rad[0], path.q_rad[0])
    assert np.allclose(brake.curve.dq_rad_s[0], path.dq_rad_s[0]) or len(brake.curve.t_s) == 1
    assert not brake.curve.dq_rad_s[-1].any()
    assert violation(brake.curve, LIMITS, 0.01) is None
    times = np.linspace(0.0, brake.curve.duration_s, 60)
    on_path = path.sample(np.linspace(0.0, brake.path_time_s[-1], 4000))[0]
    for q in brake.curve.sample(times)[0]:
        assert np.abs(on_path - q).max(axis=1).min() < 1e-3  # the comb's own spacing
    assert np.allclose(brake.curve.q_rad, path.sample(brake.path_time_s)[0])
    assert np.all(np.diff(brake.path_time_s) >= 0.0) and brake.path_time_s[-1] <= path.duration_s


@pytest.mark.parametrize("seed", range(4))
def test_the_kernel_equals_its_slow_twin(seed: int) -> None:
    path = cut(a_path(seed), 0.3, 1.0)
    grid = braking._grid(path, 0.0, path.duration_s)
    slopes, curvatures = braking._coefficients(path, grid)
    times, path_times, squares = np.empty(len(grid)), np.empty(len(grid)), np.empty(len(grid))
    n = braking._slow_down(grid, slopes, curvatures, LIMITS.max_acceleration_rad_s2, 0.0, 1.0, times, path_times, squares)
    slow_times, slow_squares = slow_slow_down(grid, slopes, curvatures, LIMITS.max_acceleration_rad_s2)
    assert path_times[:n] == pytest.approx(slow_times) and squares[:n] == pytest.approx(slow_squares)
    assert np.all(np.diff(times[:n]) > 0.0)


def test_a_cruising_straight_line_stops_in_v_over_a() -> None:
    line = straight(np.array([-2.0, -1.0]), np.array([2.0, 1.0]))
    middle = cut(line, line.duration_s / 2, line.duration_s)
    brake = brake_along(middle, LIMITS.max_acceleration_rad_s2)
    due_s = (np.abs(middle.dq_rad_s[0]) / LIMITS.max_acceleration_rad_s2).max()
    assert brake.curve.duration_s == pytest.approx(due_s, abs=2e-3)


def test_what_rests_or_is_over_stops_at_once() -> None:
    q = np.array([[0.3, 0.4]])
    waiting = JointTrajectory(np.array([0.0, 2.0]), np.repeat(q, 2, axis=0), np.zeros((2, 2)))
    for path in (waiting, JointTrajectory(np.zeros(1), q, np.zeros((1, 2)))):
        brake = brake_along(path, LIMITS.max_acceleration_rad_s2)
        assert brake.curve.duration_s < 1e-6
        assert np.array_equal(brake.curve.q_rad[-1], q[0])


@pytest.mark.parametrize("seed", range(5))
def test_cut_and_join_give_the_curve_back(seed: int) -> None:
    path = a_path(seed)
    a, b = 0.21 * path.duration_s, 0.77 * path.duration_s
    again = join([cut(path, 0.0, a), cut(path, a, b), cut(path, b, path.duration_s)])
    times = np.linspace(0.0, path.duration_s, 1001)
    for mine, theirs in zip(again.sample(times)[:2], path.sample(times)[:2], strict=True):
        assert np.allclose(mine, theirs, atol=1e-9)


def test_cut_beyond_the_end_rests() -> None:
    line = straight(np.zeros(2), np.ones(2))
    tail = cut(line, line.duration_s + 1.0, line.duration_s + 2.0)
    assert np.allclose(tail.q_rad, 1.0) and not tail.dq_rad_s.any()
    with pytest.raises(ValueError, match="cannot cut"):
        cut(line, 1.0, 0.5)
