"""Corners cut from a path: points are skipped where the straight way past them is free. Twin: ``tests/support/slow_shorten.py``."""

from __future__ import annotations

from common.kernel import kernel, leaf
from services.planner.kernels.way import line_between_is_free, new_rooms

__all__ = ["cut_corners", "has_repeats"]


@leaf
def has_repeats(path, least_rad):  # type: ignore[no-untyped-def]
    """Whether a piece of ``path`` (P, J) is no longer than ``least_rad``."""
    for k in range(len(path) - 1):
        d2 = 0.0
        for j in range(path.shape[1]):
            d2 += (path[k + 1, j] - path[k, j]) ** 2
        if d2 <= least_rad * least_rad:
            return True
    return False


@kernel
def cut_corners(arm, solids, cells, safety_m, step_m, path, first, n_checks, kept, proven):  # type: ignore[no-untyped-def]
    """Indices of the points of ``path`` (P, J) that stay, into ``kept`` (P,); returns how many.

    ``proven`` (P,) uint8 out: 1 where the piece that begins at a kept point was looked at here and is free.

    The points themselves are free. From each point on, the farthest point that a free straight segment reaches, by halving; at most
    ``n_checks`` segments are tried.
    Points up to ``first`` all stay.
    """
    n, rooms = 0, new_rooms(arm, len(path))
    proven[:] = 0
    for k in range(first + 1):
        kept[n] = k
        n += 1
    while kept[n - 1] < len(path) - 1:
        here, ahead = kept[n - 1], len(path) - 1
        while ahead > here + 1:
            if n_checks <= 0:
                ahead = here + 1
                break
            n_checks -= 1
            ends = path[here], path[ahead], rooms[here], rooms[ahead]
            if line_between_is_free(arm, solids, cells, safety_m, step_m, *ends):
                proven[n - 1] = 1
                break
            ahead = here + max(1, (ahead - here) // 2)
        kept[n] = ahead
        n += 1
    return n
