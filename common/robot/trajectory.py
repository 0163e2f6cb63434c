"""The interpolant: cubic Hermite between timed knots. Checked by the planner, driven by the executor, one function for both.

A step sequence ``t_s[K], q_rad[K, J], dq_rad_s[K, J]`` is a curve with continuous position and velocity. Before the first knot and after
the last the arm rests there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["JointTrajectory", "validate"]

F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class JointTrajectory:
    """A timed joint curve: ``t_s`` (K,) strictly increasing from 0, ``q_rad`` and ``dq_rad_s`` (K, J); K >= 1."""

    t_s: F64
    q_rad: F64
    dq_rad_s: F64

    @property
    def duration_s(self) -> float:
        """Time of the last knot."""
        return float(self.t_s[-1])

    def sample(self, t_s: float | F64) -> tuple[F64, F64, F64]:
        """Position, velocity and acceleration at time(s) ``t_s``; shapes (J,) for a number, (T, J) for an array.

        Outside the knots: the end positions at rest.
        """
        times = np.atleast_1d(np.asarray(t_s, dtype=np.float64))
        q, dq, ddq = _hermite(self.t_s, self.q_rad, self.dq_rad_s, times)
        if np.ndim(t_s) == 0:
            return q[0], dq[0], ddq[0]
        return q, dq, ddq


def _hermite(t_s: F64, q_rad: F64, dq_rad_s: F64, times: F64) -> tuple[F64, F64, F64]:
    if len(t_s) == 1:
        zeros = np.zeros((len(times), q_rad.shape[1]))
        return np.repeat(q_rad, len(times), axis=0), zeros, zeros.copy()
    i = np.clip(np.searchsorted(t_s, times, side="right") - 1, 0, len(t_s) - 2)
    h = (t_s[i + 1] - t_s[i])[:, None]
    u = np.clip((times - t_s[i])[:, None] / h, 0.0, 1.0)
    q0, q1, v0, v1 = q_rad[i], q_rad[i + 1], dq_rad_s[i] * h, dq_rad_s[i + 1] * h
    # q(u) = q0 + v0 u + (3 d - 2 v0 - v1) u^2 + (v0 + v1 - 2 d) u^3 with d = q1 - q0
    d = q1 - q0
    c2, c3 = 3.0 * d - 2.0 * v0 - v1, v0 + v1 - 2.0 * d
    q = q0 + u * (v0 + u * (c2 + u * c3))
    dq = (v0 + u * (2.0 * c2 + 3.0 * u * c3)) / h
    ddq = (2.0 * c2 + 6.0 * u * c3) / h**2
    resting = (times < t_s[0]) | (times > t_s[-1])
    dq[resting] = 0.0
    ddq[resting] = 0.0
    return q, dq, ddq


def validate(t_s: F64, q_rad: F64, dq_rad_s: F64, n_joints: int) -> str | None:
    """What is wrong with the arrays of a trajectory, or None: shapes, finiteness, increasing times from 0."""
    if t_s.ndim != 1 or len(t_s) == 0:
        return f"t_s must be a non-empty vector, got shape {t_s.shape}"
    expected = (len(t_s), n_joints)
    if q_rad.shape != expected or dq_rad_s.shape != expected:
        return f"q_rad and dq_rad_s must have shape {expected}, got {q_rad.shape} and {dq_rad_s.shape}"
    if not (np.all(np.isfinite(t_s)) and np.all(np.isfinite(q_rad)) and np.all(np.isfinite(dq_rad_s))):
        return "a value is not finite"
    if t_s[0] != 0.0 or np.any(np.diff(t_s) <= 0.0):
        return "t_s must start at 0 and increase strictly"
    return None
