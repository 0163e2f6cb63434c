"""Braking along the path: the same curve, run ever slower, as hard as the joints' acceleration limits allow.

With path time s and x = (ds/dt)^2 the joint acceleration is q''(s) x + q'(s) s_dotdot (Bobrow, Dubowsky and Gibson 1985). At x <= 1 the
choice s_dotdot = 0 keeps any limit that the curve itself keeps, so the greedy choice, the most negative s_dotdot that is allowed here,
never runs into a trap. The arm never leaves the path that was checked. One function for the planner's stops and for the executor's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.kernel import kernel
from common.robot.trajectory import JointTrajectory

__all__ = ["Brake", "brake_along"]

F64 = NDArray[np.float64]
PATH_STEP_S = 0.002  # our choice: within it the limits are checked at both ends; the error is far below the tolerance
WINDOW_S = 1.0  # the path is sampled so far at a time: most brakes end within
LEAST_SLOPE_RAD_S = 1e-9  # slower joints do not bound the deceleration: the path rests there
LEAST_TIME_S = 1e-7  # two knots nearer than this are one


@dataclass(frozen=True, eq=False)
class Brake:
    """A brake as a curve of its own, ending at rest on the path.

    Attributes:
        curve: knots of the braking motion, time from 0.
        path_time_s: (K,) how far along the original path, in its time, each knot lies.
    """

    curve: JointTrajectory
    path_time_s: F64


def brake_along(path: JointTrajectory, max_acceleration_rad_s2: F64) -> Brake:
    """Brake from the beginning of ``path``, which is being driven at its nominal speed, until the arm rests on it.

    Args:
        path: what would be driven from now on; it keeps the limits and ends at rest.
        max_acceleration_rad_s2: (J,).
    """
    parts: list[tuple[F64, F64, F64]] = []
    from_s, time_s, x = 0.0, 0.0, 1.0
    while x > 0.0 and from_s < path.duration_s:
        to_s = min(from_s + WINDOW_S, path.duration_s)
        grid = _grid(path, from_s, to_s)
        slopes, curvatures = _coefficients(path, grid)
        times, path_times, squares = np.empty(len(grid)), np.empty(len(grid)), np.empty(len(grid))
        n = _slow_down(grid, slopes, curvatures, max_acceleration_rad_s2, time_s, x, times, path_times, squares)
        first = 1 if parts else 0
        parts.append((times[first:n], path_times[first:n], squares[first:n]))
        from_s, time_s, x = to_s, times[n - 1], squares[n - 1]
    if not parts:
        return _as_curve(path, np.zeros(1), np.zeros(1), np.ones(1))
    times, path_times, squares = (np.concatenate(column) for column in zip(*parts, strict=True))
    return _as_curve(path, times, path_times, np.sqrt(squares))


@kernel
def _slow_down(grid, slopes, curvatures, max_acceleration, time_s, x, times, path_times, squares):  # type: ignore[no-untyped-def]
    """Walk along ``grid`` (N,) from ``time_s`` and x on, as hard as allowed; fills time, path time and x at each knot, returns how many."""
    n_joints = len(max_acceleration)
    times[0], path_times[0], squares[0] = time_s, grid[0], x
    for i in range(len(grid) - 1):
        ds, hardest = grid[i + 1] - grid[i], np.inf
        for j in range(2 * n_joints):  # no joint exceeds its limit at either end of the cell
            slope = slopes[i, j]
            bend = curvatures[i, j] * x
            room = max_acceleration[j % n_joints] + (bend if slope > 0.0 else -bend if slope < 0.0 else 0.0)
            hardest = min(hardest, room / max(abs(slope), LEAST_SLOPE_RAD_S))
        hardest = max(hardest, 0.0)
        x_next = max(x - 2.0 * hardest * ds, 0.0)
        gone = ds if x_next > 0.0 else x / (2.0 * hardest)
        times[i + 1] = times[i] + 2.0 * gone / (math.sqrt(x) + math.sqrt(x_next))
        path_times[i + 1], squares[i + 1] = grid[i] + gone, x_next
        x = x_next
        if x == 0.0:
            return i + 2
    return len(grid)


def _grid(path: JointTrajectory, from_s: float, to_s: float) -> F64:
    """Path times, at most a step apart, all knots among them: acceleration may jump at a knot."""
    steps = np.linspace(from_s, to_s, max(int(np.ceil((to_s - from_s) / PATH_STEP_S)), 1) + 1)
    knots = path.t_s[(path.t_s > from_s) & (path.t_s < to_s)]
    grid = np.union1d(steps, knots)
    keep = np.concatenate([[True], np.diff(grid) > LEAST_TIME_S])
    keep[-1] = True
    return np.asarray(grid[keep])


def _coefficients(path: JointTrajectory, grid: F64) -> tuple[F64, F64]:
    """Slopes and curvatures (cells, 2 J): the acceleration at both ends of a cell is curvature * x + slope * s_dotdot."""
    ds = np.diff(grid)[:, None]
    middle = (grid[:-1] + grid[1:]) / 2.0
    _, slope, _ = path.sample(grid)
    q_middle_1 = path.sample(middle - 0.25 * ds[:, 0])[2]
    q_middle_2 = path.sample(middle + 0.25 * ds[:, 0])[2]
    first = 1.5 * q_middle_1 - 0.5 * q_middle_2  # acceleration is linear inside the cell: its one-sided values at both ends
    last = 1.5 * q_middle_2 - 0.5 * q_middle_1
    slope_last = slope[1:] + 2.0 * ds * last  # x at the cell's end is x + 2 s_dotdot ds
    return np.hstack([slope[:-1], slope_last]), np.hstack([first, last])


def _as_curve(path: JointTrajectory, times: F64, path_times: F64, speeds: F64) -> Brake:
    q, slope, _ = path.sample(path_times)
    dq = slope * speeds[:, None]
    keep = np.concatenate([[True], np.diff(times) > LEAST_TIME_S])
    t_s, q, dq, path_times = times[keep], q[keep], dq[keep], path_times[keep]
    dq[-1] = 0.0  # at rest: stopped, or the end of the path
    return Brake(JointTrajectory(t_s, q, dq), path_times)
