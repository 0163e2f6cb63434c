"""How fast and how hard a Hermite curve moves each joint at most: exact, by the extremes of each cubic piece, never by sampling.

One function for the planner, which times curves, and for the executor, which refuses those that break a limit.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from common.robot.trajectory import JointTrajectory

__all__ = ["hermite_rates", "largest_rates"]

F64 = NDArray[np.float64]


def largest_rates(curve: JointTrajectory) -> tuple[F64, F64]:
    """(J,) largest speed in rad/s and (J,) largest acceleration in rad/s^2, by value; infinite where a number is absurd."""
    n_joints = curve.q_rad.shape[1]
    speed, acceleration = np.empty(n_joints), np.empty(n_joints)
    hermite_rates(curve.t_s, curve.q_rad, curve.dq_rad_s, speed, acceleration)
    return speed, acceleration


@njit(cache=True, nogil=True, error_model="numpy")
def hermite_rates(t_s, q_rad, dq_rad_s, speed, acceleration):  # type: ignore[no-untyped-def]
    """:func:`largest_rates` into ``speed`` and ``acceleration`` (J,).

    On a piece acceleration is linear in time and velocity quadratic: extremes lie at its ends or where acceleration is zero.
    """
    for j in range(q_rad.shape[1]):
        fastest, hardest = 0.0, 0.0
        for k in range(len(t_s)):
            fastest = _larger(fastest, dq_rad_s[k, j])
        for k in range(len(t_s) - 1):
            h = t_s[k + 1] - t_s[k]
            mean, v0, v1 = (q_rad[k + 1, j] - q_rad[k, j]) / h, dq_rad_s[k, j], dq_rad_s[k + 1, j]
            a0 = (6.0 * mean - 4.0 * v0 - 2.0 * v1) / h
            a1 = (2.0 * v0 + 4.0 * v1 - 6.0 * mean) / h
            hardest = _larger(_larger(hardest, a0), a1)
            if (a0 < 0.0) != (a1 < 0.0) and a0 != a1:
                u = a0 / (a0 - a1)
                fastest = _larger(fastest, v0 + h * u * (a0 + 0.5 * (a1 - a0) * u))
        speed[j], acceleration[j] = fastest, hardest


@njit(cache=True, nogil=True, inline="always")
def _larger(most, value):  # type: ignore[no-untyped-def]
    """The larger by value; what is not a number counts as infinite, so that no comparison lets it through."""
    if math.isnan(value) or math.isnan(most):
        return np.inf
    return max(most, abs(value))
