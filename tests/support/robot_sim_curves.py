"""Joint curves for the executor's tests: straight lines at the limits, and swings from any state to rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.robot.trajectory import JointTrajectory
from services.robot_sim.core.admission import Motion
from services.robot_sim.core.limits import Limits, violation

F64 = NDArray[np.float64]
NS = 1_000_000_000
TICK_NS = 8_000_000

# Two joints of different vigour are enough for every rule of the executor.
LIMITS = Limits(np.array([-3.0, -3.0]), np.array([3.0, 3.0]), np.array([2.0, 3.0]), np.array([5.0, 4.0]))


def straight(q_from: F64, q_to: F64, limits: Limits = LIMITS) -> JointTrajectory:
    """The fastest straight line from rest to rest: a trapezoid of velocity, exactly a Hermite curve of four knots."""
    way = np.asarray(q_to) - np.asarray(q_from)
    if not way.any():
        return JointTrajectory(np.array([0.0]), np.array([q_from]), np.zeros((1, len(way))))
    slope = np.maximum(np.abs(way), 1e-12)
    speed, acceleration = float((limits.max_velocity_rad_s / slope).min()), float((limits.max_acceleration_rad_s2 / slope).min())
    speed = min(speed, np.sqrt(acceleration))  # shares of the way per second
    rise, cruise = speed / acceleration, 1.0 / speed - speed / acceleration
    t = np.array([0.0, rise, rise + cruise, 2.0 * rise + cruise])
    share = np.array([0.0, 0.5 * speed * rise, 1.0 - 0.5 * speed * rise, 1.0])
    rate = np.array([0.0, speed, speed, 0.0])
    keep = np.concatenate([[True], np.diff(t) > 1e-9])
    q = np.asarray(q_from) + share[:, None] * way
    return JointTrajectory(t[keep], q[keep], (rate[:, None] * way)[keep])


def swing(q_from: F64, dq_from: F64, q_to: F64, limits: Limits = LIMITS, n_knots: int = 40) -> JointTrajectory:
    """A quintic from any state to rest, as fast as the limits let it be (within 15 %); it may leave the position limits."""
    duration = 0.1
    curve = _quintic(q_from, dq_from, q_to, duration, n_knots)
    while violation(curve, limits, 0.0) and duration < 20.0:
        duration *= 1.15
        curve = _quintic(q_from, dq_from, q_to, duration, n_knots)
    return curve


def _quintic(q0: F64, v0: F64, q1: F64, duration: float, n_knots: int) -> JointTrajectory:
    t = np.linspace(0.0, duration, n_knots)
    u = (t / duration)[:, None]
    h10, d10 = u - 6 * u**3 + 8 * u**4 - 3 * u**5, 1 - 18 * u**2 + 32 * u**3 - 15 * u**4
    h01, d01 = 10 * u**3 - 15 * u**4 + 6 * u**5, 30 * u**2 - 60 * u**3 + 30 * u**4
    way = np.asarray(q1) - np.asarray(q0)
    q = np.asarray(q0) + h10 * np.asarray(v0) * duration + h01 * way
    dq = d10 * np.asarray(v0) + d01 * way / duration
    dq[-1] = 0.0
    return JointTrajectory(t, q, dq)


def motion(id: str, curve: JointTrajectory, start_ns: int = 0, *, kind: str = "motion", splice: tuple[str, float] | None = None) -> Motion:
    splice_id, splice_time_s = splice if splice else (None, None)
    return Motion(id, kind, start_ns, curve.t_s, curve.q_rad, curve.dq_rad_s, splice_id, splice_time_s)  # type: ignore[arg-type]
