"""The slow obvious way to slow down along a path: the twin of the kernel in common.robot.braking."""

from __future__ import annotations

import numpy as np

__all__ = ["slow_slow_down"]


def slow_slow_down(
    grid: np.ndarray, slopes: np.ndarray, curvatures: np.ndarray, max_acceleration: np.ndarray
) -> tuple[list[float], list[float]]:
    """Path times and squared speeds at the knots, from full speed on."""
    x, path_times, squares = 1.0, [float(grid[0])], [1.0]
    for i, ds in enumerate(np.diff(grid)):
        steepness = np.maximum(np.abs(slopes[i]), 1e-9)
        room = np.tile(max_acceleration, 2) + np.sign(slopes[i]) * curvatures[i] * x
        deceleration = max(float((room / steepness).min()), 0.0)
        x_next = max(x - 2.0 * deceleration * ds, 0.0)
        path_times.append(float(grid[i]) + (float(ds) if x_next > 0.0 else x / (2.0 * deceleration)))
        squares.append(x_next)
        x = x_next
        if x == 0.0:
            break
    return path_times, squares
