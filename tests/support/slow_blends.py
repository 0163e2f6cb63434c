"""The slow, obvious twin of ``services/planner/kernels/blends.py``."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

F64 = np.ndarray

__all__ = ["point_on_blends", "reach_of_corners"]


def reach_of_corners(path: F64, share: float, is_free: Callable[[F64], bool]) -> F64:
    """(P,) reach of each corner: the largest of six halvings whose parabola is free at 400 places."""
    lengths = np.linalg.norm(np.diff(path, axis=0), axis=1)
    reach = np.zeros(len(path))
    for k in range(1, len(path) - 1):
        before = lengths[k - 1] * (0.95 if k == 1 else 0.5)
        after = lengths[k] * (0.95 if k == len(path) - 2 else 0.5)
        for wanted in share * min(before, after) * 0.5 ** np.arange(6):
            if wanted < 1e-4:
                break
            a = path[k] + (path[k - 1] - path[k]) * wanted / lengths[k - 1]
            b = path[k] + (path[k + 1] - path[k]) * wanted / lengths[k]
            u = np.linspace(0, 1, 400)[:, None]
            if all(is_free(q) for q in (1 - u) ** 2 * a + 2 * u * (1 - u) * path[k] + u**2 * b):
                reach[k] = wanted
                break
    return reach


def point_on_blends(path: F64, reach: F64, s: float) -> F64:
    """(J,) the point at parameter ``s``: along a line by its length, over a blend by twice its reach."""
    for k in range(len(path) - 1):
        length = np.linalg.norm(path[k + 1] - path[k])
        unit = (path[k + 1] - path[k]) / length
        line = length - reach[k] - reach[k + 1]
        if s <= line or k == len(path) - 2:
            return path[k] + unit * (reach[k] + s)
        s -= line
        if s <= 2 * reach[k + 1]:
            u = s / (2 * reach[k + 1])
            a = path[k + 1] - unit * reach[k + 1]
            b = path[k + 1] + (path[k + 2] - path[k + 1]) / np.linalg.norm(path[k + 2] - path[k + 1]) * reach[k + 1]
            return (1 - u) ** 2 * a + 2 * u * (1 - u) * path[k + 1] + u**2 * b
        s -= 2 * reach[k + 1]
    raise AssertionError("beyond the end")
