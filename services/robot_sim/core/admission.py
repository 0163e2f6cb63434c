"""May a trajectory drive the arm, and from when? Arrays, limits, and whether it begins where the arm will be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from common.robot.trajectory import JointTrajectory, validate
from services.robot_sim.config import ExecutorConfig
from services.robot_sim.core.limits import Limits, violation
from services.robot_sim.core.timeline import NS, Segment, Timeline

__all__ = ["Motion", "admit"]

F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Motion:
    """A trajectory as it came: ``start_ns`` on this machine's monotonic clock, arrays unchecked.

    With ``splice_id`` the instant of its time 0 is ``splice_time_s`` along that trajectory, on the arm's own timeline, and ``start_ns``
    does not matter: no clock can open a gap between the two curves.
    """

    id: str
    kind: Literal["motion", "stop"]
    start_ns: int
    t_s: F64
    q_rad: F64
    dq_rad_s: F64
    splice_id: str | None = None
    splice_time_s: float | None = None


def admit(motion: Motion, timeline: Timeline, now_ns: int, limits: Limits, config: ExecutorConfig) -> Segment | str:
    """The segment that takes over from ``timeline``, or why there is none.

    Args:
        motion: the candidate.
        timeline: what is being driven.
        now_ns: instant of the last reference that was given out; nothing can take over earlier.
        limits: of the arm.
        config: tolerances.
    """
    curve = _curve(motion, limits, config)
    if isinstance(curve, str):
        return curve
    if motion.splice_id is None:
        start_ns = _start_from_rest(motion, curve, now_ns, config)
    else:
        start_ns = _start_of_splice(motion, timeline, now_ns, config)
    if isinstance(start_ns, str):
        return start_ns
    segment = Segment(motion.id, motion.kind, curve, start_ns, max(start_ns, now_ns))
    gap = _gap(segment, timeline, config)
    if gap is None:
        return segment
    from_rest = float(np.abs(curve.dq_rad_s[0]).max()) <= config.splice_velocity_rad_s
    late = Segment(motion.id, motion.kind, curve, now_ns, now_ns)  # what begins at rest may simply begin later
    return late if from_rest and now_ns > start_ns and _gap(late, timeline, config) is None else gap


def _curve(motion: Motion, limits: Limits, config: ExecutorConfig) -> JointTrajectory | str:
    if not motion.id:
        return "it has no id"
    if motion.t_s.size > config.max_knots:
        return f"it has {motion.t_s.size} knots, at most {config.max_knots} are taken"
    fault = validate(motion.t_s, motion.q_rad, motion.dq_rad_s, len(limits.position_min_rad))
    if fault:
        return fault
    curve = JointTrajectory(motion.t_s, motion.q_rad, motion.dq_rad_s)
    if np.abs(curve.dq_rad_s[-1]).max() > config.splice_velocity_rad_s:
        return f"it ends in motion ({np.abs(curve.dq_rad_s[-1]).max():.3g} rad/s)"
    return violation(curve, limits, config.limit_tolerance) or curve


def _start_from_rest(motion: Motion, curve: JointTrajectory, now_ns: int, config: ExecutorConfig) -> int | str:
    if np.abs(curve.dq_rad_s[0]).max() > config.splice_velocity_rad_s:
        return "it starts in motion and names no trajectory to splice into"
    if now_ns - motion.start_ns > config.start_late_max_s * NS:
        return f"it starts {(now_ns - motion.start_ns) / NS:.3f} s in the past"
    if motion.start_ns - now_ns > config.start_ahead_max_s * NS:
        return f"it starts {(motion.start_ns - now_ns) / NS:.3f} s ahead"
    return max(motion.start_ns, now_ns)


def _start_of_splice(motion: Motion, timeline: Timeline, now_ns: int, config: ExecutorConfig) -> int | str:
    if motion.splice_time_s is None or not np.isfinite(motion.splice_time_s):
        return f"splice_time_s is {motion.splice_time_s}"
    named = [i for i, s in enumerate(timeline.segments) if s.id == motion.splice_id]
    if not named:
        return f"it splices into {motion.splice_id!r}, the arm drives {timeline.active(now_ns).id!r}"
    into, following = timeline.segments[named[-1]], timeline.segments[named[-1] + 1 :]
    if abs(motion.splice_time_s) > into.curve.duration_s + config.start_ahead_max_s:
        return f"splice_time_s {motion.splice_time_s:.3f} lies beyond the end of {into.id!r} ({into.curve.duration_s:.3f} s)"
    start_ns = into.instant_ns(motion.splice_time_s)
    if now_ns - start_ns > config.start_late_max_s * NS:
        return f"its splice is {(now_ns - start_ns) / NS:.3f} s in the past"
    if following and start_ns > following[0].takeover_ns:
        return f"at {motion.splice_time_s:.3f} s {into.id!r} has given way to {following[0].id!r}"
    return start_ns


def _gap(segment: Segment, timeline: Timeline, config: ExecutorConfig) -> str | None:
    """How far the candidate is from the reference at its takeover; None if they meet."""
    q, dq = timeline.state(segment.takeover_ns)
    q_new, dq_new = segment.state(segment.takeover_ns)
    dq_gap, q_gap = float(np.abs(dq_new - dq).max()), float(np.abs(q_new - q).max())
    if q_gap <= config.splice_position_rad and dq_gap <= config.splice_velocity_rad_s:
        return None
    late_s = (segment.takeover_ns - segment.start_ns) / NS
    return f"at its takeover ({late_s * 1e3:.1f} ms late) it is {q_gap:.3g} rad and {dq_gap:.3g} rad/s from the reference"
