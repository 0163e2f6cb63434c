"""A shorter path of the same kind: random shortcuts, most of them across corners, where length can be saved.

Source: Geraerts and Overmars, "Creating high-quality paths for motion planning" (2007), shortcuts. That most are drawn about a corner is
ours.
Twin: ``tests/support/slow_refine.py``.
"""

from __future__ import annotations

import math

import numpy as np

from common.kernel import copy_row, kernel, leaf
from services.planner.kernels.way import line_between_is_free, new_rooms
from services.planner.kernels.xoshiro import uniform

__all__ = ["refine"]

CORNER_SHARE = 0.7  # of the draws that span a corner; our choice
LEAST_GAIN_RAD = 2e-3  # what saves less is not looked at; our choice
IDLE_DRAWS = 20  # draws a look at the most: a path that is nearly straight has little to look at


@leaf
def _place(path, n, at_rad, q):  # type: ignore[no-untyped-def]
    """Fill ``q`` (J,) with the point ``at_rad`` along the first ``n`` points of ``path``; returns the piece it lies on."""
    k = 0
    while True:
        length = 0.0
        for j in range(len(q)):
            length += (path[k + 1, j] - path[k, j]) ** 2
        length = math.sqrt(length)
        if at_rad <= length or k == n - 2:
            share = min(1.0, at_rad / max(length, 1e-12))
            for j in range(len(q)):
                q[j] = path[k, j] + share * (path[k + 1, j] - path[k, j])
            return k
        at_rad -= length
        k += 1


@leaf
def _lengths(path, n, along):  # type: ignore[no-untyped-def]
    """Fill ``along[:n]`` with the way from the first point to each."""
    along[0] = 0.0
    for k in range(1, n):
        total = 0.0
        for j in range(path.shape[1]):
            total += (path[k, j] - path[k - 1, j]) ** 2
        along[k] = along[k - 1] + math.sqrt(total)


@leaf
def _draw(along, n, first, rng):  # type: ignore[no-untyped-def]
    """Two places along the path, the nearer one first."""
    if n > first + 2 and uniform(rng) < CORNER_SHARE:
        corner = first + 1 + int(uniform(rng) * (n - first - 2))
        before, after = uniform(rng), uniform(rng)
        return along[corner] - before * (along[corner] - along[first]), along[corner] + after * (along[n - 1] - along[corner])
    a = along[first] + uniform(rng) * (along[n - 1] - along[first])
    b = along[first] + uniform(rng) * (along[n - 1] - along[first])
    return min(a, b), max(a, b)


@kernel
def refine(arm, solids, cells, safety_m, step_m, path, proven, n, first, n_looks, rng):  # type: ignore[no-untyped-def]
    """Shorten ``path[:n]`` in place; returns the new number of points, at most ``len(path)``.

    Args:
        arm, solids, cells, safety_m, step_m: as for the checks.
        path: (P, J) buffer; its first ``n`` points are a path.
        proven: (P,) uint8: not zero where the piece that begins at a point is known to be free; kept up to date, a part of a piece counts
            as the piece.
        first: points before it stay.
        n_looks: straight segments that are looked at, at most.
        rng: (4,) state of the generator; advanced.
    """
    along, q_a, q_b = np.empty(len(path)), np.empty(path.shape[1]), np.empty(path.shape[1])
    rooms = new_rooms(arm, 2)
    _lengths(path, n, along)
    draws = n_looks * IDLE_DRAWS
    while n_looks > 0 and draws > 0 and n > first + 2:
        draws -= 1
        at_a, at_b = _draw(along, n, first, rng)
        a, b = _place(path, n, at_a, q_a), _place(path, n, at_b, q_b)
        straight = 0.0
        for j in range(len(q_a)):
            straight += (q_b[j] - q_a[j]) ** 2
        if a == b or at_b - at_a - math.sqrt(straight) < LEAST_GAIN_RAD or n - (b - a) + 2 > len(path):
            continue
        n_looks -= 1
        rooms[:, 0] = np.nan
        if not line_between_is_free(arm, solids, cells, safety_m, step_m, q_a, q_b, rooms[0], rooms[1]):
            continue
        n = _replace(path, proven, n, a, b, q_a, q_b)
        _lengths(path, n, along)
    return n


@leaf
def _replace(path, proven, n, a, b, q_a, q_b):  # type: ignore[no-untyped-def]
    """Put two points in the place of the points a + 1 .. b; returns the new number of points."""
    shift, rest = 2 - (b - a), proven[b]
    if shift > 0:
        for k in range(n - 1, b, -1):
            copy_row(path[k], path[k + shift])
            proven[k + shift] = proven[k]
    elif shift < 0:
        for k in range(b + 1, n):
            copy_row(path[k], path[k + shift])
            proven[k + shift] = proven[k]
    copy_row(q_a, path[a + 1])
    copy_row(q_b, path[a + 2])
    proven[a + 1], proven[a + 2] = 1, rest
    return n + shift
