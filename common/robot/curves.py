"""Cutting and joining of Hermite curves; both are exact, a part of a cubic is a cubic."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from common.robot.trajectory import JointTrajectory

__all__ = ["cut", "join"]

MIN_PIECE_S = 1e-6  # a knot nearer to a cut than this is dropped: it would change the curve by less than rounding does


def cut(curve: JointTrajectory, from_s: float, to_s: float) -> JointTrajectory:
    """The part of ``curve`` between two times, its own time beginning at 0; outside its knots the curve rests.

    Raises:
        ValueError: ``to_s`` before ``from_s``.
    """
    if to_s < from_s:
        raise ValueError(f"cannot cut from {from_s} to {to_s} s")
    if to_s - from_s < MIN_PIECE_S:
        q, dq, _ = curve.sample(from_s)
        return JointTrajectory(np.zeros(1), q[None], dq[None])
    inner = curve.t_s[(curve.t_s > from_s + MIN_PIECE_S) & (curve.t_s < to_s - MIN_PIECE_S)]
    times = np.concatenate([[from_s], inner, [to_s]])
    q, dq, _ = curve.sample(times)
    return JointTrajectory(times - from_s, q, dq)


def join(parts: Sequence[JointTrajectory]) -> JointTrajectory:
    """Parts one after the other; each begins where and as fast as the one before ends (the first knot of a later part is dropped)."""
    t_s, q, dq = [parts[0].t_s], [parts[0].q_rad], [parts[0].dq_rad_s]
    offset_s = parts[0].duration_s
    for part in parts[1:]:
        t_s.append(part.t_s[1:] + offset_s)
        q.append(part.q_rad[1:])
        dq.append(part.dq_rad_s[1:])
        offset_s += part.duration_s
    return JointTrajectory(np.concatenate(t_s), np.concatenate(q), np.concatenate(dq))
