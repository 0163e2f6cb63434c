"""Whether a Hermite curve stays within the arm's limits, exactly: no sampling, the extrema of each cubic piece."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.robot.rates import largest_rates
from common.robot.trajectory import JointTrajectory

__all__ = ["Limits", "violation"]

F64 = NDArray[np.float64]
POSITION_TOLERANCE_RAD = 1e-6  # rounding of a goal that lies on its limit; our choice


@dataclass(frozen=True, eq=False)
class Limits:
    """Joint limits, each (J,): radians, rad/s, rad/s2."""

    position_min_rad: F64
    position_max_rad: F64
    max_velocity_rad_s: F64
    max_acceleration_rad_s2: F64


def violation(curve: JointTrajectory, limits: Limits, tolerance: float) -> str | None:
    """The first limit that a curve breaks, with joint and value; None if it keeps all.

    Args:
        curve: K knots; its arrays must be valid (:func:`common.robot.trajectory.validate`).
        limits: of the arm.
        tolerance: relative, on velocity and acceleration.
    """
    with np.errstate(all="ignore"):  # absurd numbers overflow to inf or nan, which fail the comparisons below
        low, high = _position_range(curve)
    speed, acceleration = largest_rates(curve)
    checks = (
        ("position", low, low >= limits.position_min_rad - POSITION_TOLERANCE_RAD, limits.position_min_rad),
        ("position", high, high <= limits.position_max_rad + POSITION_TOLERANCE_RAD, limits.position_max_rad),
        ("velocity", speed, speed <= limits.max_velocity_rad_s * (1.0 + tolerance), limits.max_velocity_rad_s),
        ("acceleration", acceleration, acceleration <= limits.max_acceleration_rad_s2 * (1.0 + tolerance), limits.max_acceleration_rad_s2),
    )
    for what, value, kept, limit in checks:
        if not kept.all():
            j = int(np.argmin(kept))
            return f"{what} of joint {j} reaches {value[j]:.6g}, its limit is {limit[j]:.6g}"
    return None


def _position_range(curve: JointTrajectory) -> tuple[F64, F64]:
    """Per piece the positions are q0 + c1 u + c2 u^2 + c3 u^3 with u in 0..1."""
    h = np.diff(curve.t_s)[:, None]
    q0, d = curve.q_rad[:-1], np.diff(curve.q_rad, axis=0)
    v0, v1 = curve.dq_rad_s[:-1] * h, curve.dq_rad_s[1:] * h
    c1, c2, c3 = v0, 3.0 * d - 2.0 * v0 - v1, v0 + v1 - 2.0 * d
    values = [curve.q_rad]
    root = np.sqrt(np.maximum(c2 * c2 - 3.0 * c1 * c3, 0.0))
    # Both roots of 3 c3 u^2 + 2 c2 u + c1 in the form that does not cancel (Numerical Recipes 5.6).
    k = -(c2 + np.where(c2 >= 0.0, root, -root))
    for u in (k / (3.0 * c3), c1 / k):
        inside = np.clip(np.nan_to_num(u, nan=0.0), 0.0, 1.0)
        values.append(q0 + inside * (c1 + inside * (c2 + inside * c3)))
    stacked = np.concatenate(values)
    return stacked.min(axis=0), stacked.max(axis=0)
