from __future__ import annotations

import numpy as np
import pytest

from common.robot.trajectory import JointTrajectory
from services.robot_sim.core.limits import Limits, violation
from tests.support.robot_sim_curves import LIMITS, straight


def sampled_extremes(curve: JointTrajectory) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The slow twin: a dense look."""
    q, dq, ddq = curve.sample(np.linspace(0.0, curve.duration_s, 200_001))
    return q.min(axis=0), q.max(axis=0), np.abs(dq).max(axis=0), np.abs(ddq).max(axis=0)


@pytest.mark.parametrize("seed", range(20))
def test_extremes_agree_with_dense_sampling(seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.concatenate([[0.0], np.cumsum(rng.uniform(0.05, 0.5, 5))])
    curve = JointTrajectory(t, rng.normal(0, 1, (6, 3)), rng.normal(0, 2, (6, 3)))
    low, high, speed, acceleration = sampled_extremes(curve)
    exact = Limits(low, high, speed, acceleration)
    assert violation(curve, exact, 1e-3) is None
    for field, factor in (("max_velocity_rad_s", 0.995), ("max_acceleration_rad_s2", 0.995)):
        narrower = Limits(**{**exact.__dict__, field: getattr(exact, field) * factor})
        assert violation(curve, narrower, 1e-3) is not None
    assert "position" in str(violation(curve, Limits(low, high - 1e-3, speed, acceleration), 1e-3))
    assert "position" in str(violation(curve, Limits(low + 1e-3, high, speed, acceleration), 1e-3))


def test_the_fastest_straight_line_is_just_within() -> None:
    line = straight(np.array([-1.0, 0.5]), np.array([1.0, -0.5]))
    assert violation(line, LIMITS, 1e-9) is None
    faster = JointTrajectory(line.t_s * 0.98, line.q_rad, line.dq_rad_s / 0.98)
    assert "joint 0" in str(violation(faster, LIMITS, 0.01))


def test_a_peak_between_knots_counts() -> None:
    """Both knots are within the position limit, the cubic between them is not."""
    curve = JointTrajectory(np.array([0.0, 1.0]), np.full((2, 2), 2.9), np.array([[1.0, 0.0], [-1.0, 0.0]]))
    assert "position of joint 0 reaches 3.15" in str(violation(curve, LIMITS, 0.01))


def test_absurd_numbers_are_a_violation_not_a_crash() -> None:
    curve = JointTrajectory(np.array([0.0, 1e-300]), np.array([[0.0, 0.0], [1.0, 1.0]]), np.zeros((2, 2)))
    assert violation(curve, LIMITS, 0.01) is not None
