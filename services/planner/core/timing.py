"""Time along a curve within joint limits, as knots of the interpolant that is checked and driven; and braking along it."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.robot.braking import brake_along
from common.robot.curves import cut
from common.robot.rates import largest_rates
from common.robot.trajectory import JointTrajectory
from services.planner.core.separation import Caps
from services.planner.core.smoothing import Nurbs
from services.planner.kernels.blends import LINE_STEP_RAD, sample_blends, sample_count
from services.planner.kernels.timing import CANNOT_ENTER, fastest_under_caps, fastest_within

__all__ = ["Limits", "Timed", "brake", "limit_ratio", "time_blends", "time_curve", "time_polyline"]

F64 = NDArray[np.float64]
GRID_STEP_RAD = (
    0.04  # joint way between grid points, which become the knots; our choice: the arm moves about as far as between two checked poses
)
GENTLE, HARD = 0.5, 0.98  # shares of the acceleration limits that stops use, with room and without; the rest of 2 % is for rounding
FARTHER = 2.5  # how much farther along the way a gentle stop may end than a hard one; our choice
GRID_POINTS_MIN, GRID_POINTS_MAX = 24, 400
KNOT_LEAST_S = 1e-4  # knots nearer than that are one
TIGHTEN = np.array([1.0, 0.92, 0.84, 0.7, 0.5])  # of the acceleration limits, until the Hermite curve between the knots keeps them too


@dataclass(frozen=True, eq=False)
class Limits:
    """Joint limits (J,) in rad/s and rad/s^2 that a timed curve keeps."""

    velocity: F64
    acceleration: F64

    def scaled(self, velocity: float, acceleration: float) -> Limits:
        """Both limits times a factor."""
        return Limits(self.velocity * velocity, self.acceleration * acceleration)


@dataclass(frozen=True, eq=False)
class Timed:
    """A timed curve, and how far each joint of it may be from the curve that it was made from: ``astray_rad`` (J,), at the same way."""

    curve: JointTrajectory
    astray_rad: F64


def time_curve(curve: Nurbs, limits: Limits, velocity_start: F64 | None = None) -> JointTrajectory | None:
    """The fastest motion along ``curve`` within ``limits``, ending at rest; None if it cannot be entered at ``velocity_start``.

    Args:
        curve: over 0..1.
        limits: kept by the Hermite curve through the returned knots, not only at them.
        velocity_start: (J,) rad/s, along the curve's first tangent; None = from rest.
    """
    coarse = curve(np.linspace(0.0, 1.0, 50))
    length = float(np.linalg.norm(np.diff(coarse, axis=0), axis=1).sum())
    n = int(np.clip(np.ceil(length / GRID_STEP_RAD), GRID_POINTS_MIN, GRID_POINTS_MAX)) + 1
    s = np.linspace(0.0, 1.0, n)
    q, d1, d2 = curve.derivatives(s)
    timed = _time_samples(s, q, d1, d2, d2, limits, velocity_start, None)
    return None if timed is None else timed.curve


def time_blends(path_rad: F64, reach_rad: F64, limits: Limits, velocity_start: F64 | None = None, caps: Caps | None = None) -> Timed | None:
    """The fastest motion along a path (P, J) with rounded corners (``reach_rad`` (P,), :mod:`services.planner.kernels.blends`).

    It stops at corners that are not rounded, and is no faster than ``caps`` allows (but for a start that is too fast for it). None if it
    cannot be entered at ``velocity_start`` (J,) rad/s, along the first piece.
    """
    stops = np.flatnonzero(reach_rad[1:-1] <= 0.0) + 1
    parts = []
    for first, last in itertools.pairwise([0, *stops, len(path_rad) - 1]):
        path, reach = path_rad[first : last + 1], reach_rad[first : last + 1]
        n = sample_count(path, reach)
        s, (q, d1, d2, d2_before) = np.empty(n), np.empty((4, n, path.shape[1]))
        sample_blends(path, reach, s, q, d1, d2, d2_before)
        part = _time_samples(s, q, d1, d2, d2_before, limits, velocity_start if first == 0 else None, caps)
        if part is None:
            return None
        parts.append(part)
    return parts[0] if len(parts) == 1 else _one_after_the_other(parts)


def _one_after_the_other(timed: list[Timed]) -> Timed:
    """Motions that each end at rest where the next begins."""
    parts = [part.curve for part in timed]
    begin_s = np.cumsum([0.0] + [part.duration_s for part in parts])
    kept = [slice(0 if k == 0 else 1, None) for k in range(len(parts))]
    curve = JointTrajectory(
        np.concatenate([part.t_s[keep] + at_s for part, keep, at_s in zip(parts, kept, begin_s[:-1], strict=True)]),
        np.concatenate([part.q_rad[keep] for part, keep in zip(parts, kept, strict=True)]),
        np.concatenate([part.dq_rad_s[keep] for part, keep in zip(parts, kept, strict=True)]),
    )
    return Timed(curve, np.max([part.astray_rad for part in timed], axis=0))


def _time_samples(
    s: F64, q: F64, d1: F64, d2: F64, d2_before: F64, limits: Limits, velocity_start: F64 | None, caps: Caps | None
) -> Timed | None:
    """Time at samples of a path (kernels.timing's arguments), within limits also between them."""
    dq_start = np.zeros(q.shape[1]) if velocity_start is None else np.asarray(velocity_start, dtype=np.float64)
    (cap, speed, upper, time), dq, astray_rad = np.empty((4, len(s))), np.empty_like(q), np.empty(q.shape[1])
    asked = s, q, d1, d2, d2_before, limits.velocity, limits.acceleration
    out = speed, upper, time, dq, astray_rad
    if caps is None:
        cap.fill(np.inf)
        k = fastest_within(*asked, cap, dq_start, TIGHTEN, *out)
    else:
        k = fastest_under_caps(*asked, caps, dq_start, TIGHTEN, cap, *out)
    return None if k in (CANNOT_ENTER, len(TIGHTEN)) else Timed(JointTrajectory(time, q, dq), astray_rad)


def limit_ratio(trajectory: JointTrajectory, limits: Limits) -> float:
    """Largest velocity or acceleration of the Hermite curve as a share of its limit; at most 1 means: limits kept. Exact."""
    speed, acceleration = largest_rates(trajectory)
    return float(max((speed / limits.velocity).max(), (acceleration / limits.acceleration).max()))


def time_polyline(
    path_rad: F64, limits: Limits, velocity_start: F64 | None = None, caps: Caps | None = None
) -> tuple[JointTrajectory, F64] | None:
    """A motion along the straight segments of ``path_rad`` (P, J) with a stop at each corner; the last resort of smoothing.

    Each segment is driven no faster than the least of its ``caps`` allows.

    Returns:
        The motion and (P,) the times of its corners; None if it cannot be entered at ``velocity_start`` (J,).
    """
    t, q, dq = [np.zeros(1)], [path_rad[:1]], [np.zeros((1, path_rad.shape[1]))]
    corner_s = np.zeros(len(path_rad))
    if velocity_start is not None:
        dq[0][0] = velocity_start
    for k, way in enumerate(np.diff(path_rad, axis=0)):
        if np.linalg.norm(way) >= 1e-9:
            enters = velocity_start is not None and k == 0
            speed = float(velocity_start @ way) / float(way @ way) if enters else 0.0
            knots = _along_line(way, limits, speed, np.inf if caps is None else _least_cap(path_rad[k], way, limits, caps))
            if knots is None:
                return None
            part_t, s, ds = knots
            t.append(t[-1][-1] + part_t[1:])
            q.append(path_rad[k] + s[1:, None] * way)
            dq.append(ds[1:, None] * way)
        corner_s[k + 1] = t[-1][-1]
    return JointTrajectory(np.concatenate(t), np.concatenate(q), np.concatenate(dq)), corner_s


def _least_cap(q_from: F64, way: F64, limits: Limits, caps: Caps) -> float:
    """The largest ds/dt that ``caps`` allow all along ``way`` (J,) from ``q_from`` (J,), s being the share of it."""
    s = np.linspace(0.0, 1.0, 2 + int(np.linalg.norm(way) / LINE_STEP_RAD))
    fastest = np.full(len(s), np.min(limits.velocity / np.maximum(np.abs(way), 1e-12)))
    return float(np.sqrt(caps.along(s, q_from + s[:, None] * way, np.tile(way, (len(s), 1)), fastest).min()))


def _along_line(way: F64, limits: Limits, speed: float, cap: float) -> tuple[F64, F64, F64] | None:
    """Knots (time, share s of the way, ds/dt) of the fastest motion along a straight ``way`` (J,) to rest at its end.

    Accelerate, cruise, brake, each at one acceleration: pieces that the Hermite interpolant renders exactly. ``cap`` bounds ds/dt. None:
    ``speed`` (ds/dt at the start) is too fast to stop within the way.
    """
    reach = np.maximum(np.abs(way), 1e-12)
    fastest, hardest = min(float(np.min(limits.velocity / reach)), cap), float(np.min(limits.acceleration / reach))
    if speed * speed > 2.0 * hardest:
        return None
    peak = min(fastest, float(np.sqrt(hardest + 0.5 * speed * speed)))
    rise_s, brake_s = abs(peak - speed) / hardest, peak / hardest
    risen, braked = 0.5 * (speed + peak) * rise_s, 0.5 * peak * brake_s
    if speed > peak and risen + braked > 1.0:  # faster than its cruise and no room for that: brake at once
        peak, rise_s, brake_s, risen, braked = speed, 0.0, 2.0 / speed, 0.0, 1.0
    cruise_s = max(0.0, 1.0 - risen - braked) / peak
    times = np.cumsum([0.0, rise_s, cruise_s, brake_s])
    keep = np.concatenate([[True], np.diff(times) > KNOT_LEAST_S])
    keep[-1] = True
    shares, speeds = np.array([0.0, risen, 1.0 - braked, 1.0]), np.array([speed, peak, peak, 0.0])
    return times[keep], shares[keep], speeds[keep]


def brake(running: JointTrajectory, from_s: float, limits: Limits, within_s: float) -> JointTrajectory:
    """A stop along the running motion: leaves it at ``from_s`` with its velocity and comes to rest on its path.

    Gentle where that ends within ``within_s`` of the running motion's time and goes little farther, else as hard as the limits allow.

    Args:
        running: the motion under way.
        from_s: its time at which braking starts.
        limits: joint limits that hold while braking.
        within_s: time of the running motion left before the arm must stand.
    """
    remaining = cut(running, from_s, max(from_s, running.duration_s))
    hard = brake_along(remaining, HARD * limits.acceleration)
    gentle = brake_along(remaining, GENTLE * limits.acceleration)
    return (gentle if gentle.path_time_s[-1] <= min(within_s, FARTHER * hard.path_time_s[-1]) else hard).curve
