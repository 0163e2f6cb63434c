"""Which cells a solid touches: exact tests of a cube against a box, a cylinder, a sphere.

What only shares boundary with a cube does not touch it, so that a box that ends on a cell's face does not take the next cell too.
Twin: ``tests/support/slow_solid_cells.py``.
"""

from __future__ import annotations

import math

import numpy as np

from common.kernel import kernel, leaf
from services.planner.kernels.static_layer import BOX, ROOT3, SPHERE, solid_distance

__all__ = ["cube_meets_solid", "mark_solid_cells"]

SHARED_M = 1e-9  # overlaps that are thinner than this are rounding; our choice, far below any cell
PARALLEL = 1e-6  # a cross product that short: the two edges are parallel, and the faces decide
EDGES = 12  # of a cube


@leaf
def _cube_meets_box(turn, size_m, x, y, z, half_m):  # type: ignore[no-untyped-def]
    """Separating axes (Gottschalk 1996): the three faces of each, and the nine cross products of their edges.

    ``turn`` (3, 3): world <- box; (x, y, z): the cube's middle less the box's, in the world.
    """
    for r in range(3):  # the cube's faces
        reach = half_m - SHARED_M
        for c in range(3):
            reach += abs(turn[r, c]) * size_m[c]
        middle = x if r == 0 else y if r == 1 else z
        if abs(middle) >= reach:
            return False
    for c in range(3):  # the box's faces
        middle = turn[0, c] * x + turn[1, c] * y + turn[2, c] * z
        cube = half_m * (abs(turn[0, c]) + abs(turn[1, c]) + abs(turn[2, c]))
        if abs(middle) >= size_m[c] + cube - SHARED_M:
            return False
    for r in range(3):  # an edge of each: world axis r crossed with box axis c
        for c in range(3):
            ax = 0.0 if r == 0 else (-turn[2, c] if r == 1 else turn[1, c])
            ay = turn[2, c] if r == 0 else (0.0 if r == 1 else -turn[0, c])
            az = -turn[1, c] if r == 0 else (turn[0, c] if r == 1 else 0.0)
            # The sign of an axis does not matter; its length does.
            length = math.sqrt(ax * ax + ay * ay + az * az)
            if length < PARALLEL:
                continue
            reach = half_m * (abs(ax) + abs(ay) + abs(az)) - SHARED_M * length
            for k in range(3):
                reach += size_m[k] * abs(ax * turn[0, k] + ay * turn[1, k] + az * turn[2, k])
            if abs(ax * x + ay * y + az * z) >= reach:
                return False
    return True


@kernel
def _cube_meets_cylinder(turn, radius_m, half_length_m, x, y, z, half_m):  # type: ignore[no-untyped-def]
    """The part of the cube between the cylinder's two planes, seen along its axis, is a convex polygon; is the axis near enough to it?

    Its corners are among the cube's corners between the planes and the crossings of the cube's edges with the planes. Arguments as for
    :func:`_cube_meets_box`.
    """
    top = half_length_m - SHARED_M
    corner = np.empty((8, 3))
    for k in range(8):
        sx = x + (half_m if k & 1 else -half_m)
        sy = y + (half_m if k & 2 else -half_m)
        sz = z + (half_m if k & 4 else -half_m)
        for c in range(3):
            corner[k, c] = turn[0, c] * sx + turn[1, c] * sy + turn[2, c] * sz
    seen = np.empty((8 + 2 * EDGES, 2))
    n = 0
    for k in range(8):
        if abs(corner[k, 2]) < top:
            seen[n, 0], seen[n, 1] = corner[k, 0], corner[k, 1]
            n += 1
        for bit in (1, 2, 4):
            if k & bit:
                continue
            a, b = corner[k], corner[k | bit]
            for side in (-top, top):
                if (a[2] < side) != (b[2] < side):
                    share = (side - a[2]) / (b[2] - a[2])
                    seen[n, 0], seen[n, 1] = a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
                    n += 1
    return n > 0 and _axis_within(seen, n, radius_m - SHARED_M)


@leaf
def _axis_within(points, n, radius_m):  # type: ignore[no-untyped-def]
    """Whether the convex hull of ``points[:n]`` (n, 2) comes nearer than ``radius_m`` to the origin."""
    outside = False
    for i in range(n):  # the origin is outside if all points lie on one side of a line through it and one of them
        one_side = True
        for k in range(n):
            one_side = one_side and points[i, 0] * points[k, 1] - points[i, 1] * points[k, 0] >= 0.0
        outside = outside or one_side
    if not outside:
        return True
    for i in range(n):  # the hull's sides are among the segments between points, and no segment leaves the hull
        for k in range(i, n):
            ax, ay = points[i, 0], points[i, 1]
            dx, dy = points[k, 0] - ax, points[k, 1] - ay
            length2 = dx * dx + dy * dy
            share = min(max(-(ax * dx + ay * dy) / length2, 0.0), 1.0) if length2 > 0.0 else 0.0
            if (ax + share * dx) ** 2 + (ay + share * dy) ** 2 < radius_m * radius_m:
                return True
    return False


@leaf
def cube_meets_solid(kind, size_m, rotation, translation, s, x, y, z, half_m):  # type: ignore[no-untyped-def]
    """Whether the cube about the world point (x, y, z), along the world's axes, overlaps solid ``s``.

    ``kind`` to ``translation``: as in :class:`services.planner.kernels.static_layer.Solids`.
    """
    middle_m = solid_distance(kind, size_m, rotation, translation, s, x, y, z)
    if middle_m >= half_m * ROOT3:
        return False
    if middle_m < half_m - SHARED_M:
        return True
    x, y, z = x - translation[s, 0], y - translation[s, 1], z - translation[s, 2]
    if kind[s] == BOX:
        return _cube_meets_box(rotation[s], size_m[s], x, y, z, half_m)
    if kind[s] == SPHERE:
        u, v, w = max(abs(x) - half_m, 0.0), max(abs(y) - half_m, 0.0), max(abs(z) - half_m, 0.0)
        return math.sqrt(u * u + v * v + w * w) < size_m[s, 0] - SHARED_M
    return _cube_meets_cylinder(rotation[s], size_m[s, 0], size_m[s, 1], x, y, z, half_m)


@kernel
def mark_solid_cells(kind, size_m, rotation, translation, reach_m, origin_m, shape, cell_m, occupied):  # type: ignore[no-untyped-def]
    """Set ``occupied`` (n_cells,) uint8 for every cell that a solid overlaps; what lies outside the grid is left out.

    ``reach_m`` (S, 3): half the edges of the box along the world's axes that contains a solid.
    """
    half_m = cell_m / 2.0
    first, last = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    for s in range(len(kind)):
        for axis in range(3):
            first[axis] = max(0, math.floor((translation[s, axis] - reach_m[s, axis] - origin_m[axis]) / cell_m) - 1)
            last[axis] = min(shape[axis] - 1, math.ceil((translation[s, axis] + reach_m[s, axis] - origin_m[axis]) / cell_m) + 1)
        for ix in range(first[0], last[0] + 1):
            x = origin_m[0] + (ix + 0.5) * cell_m
            for iy in range(first[1], last[1] + 1):
                y = origin_m[1] + (iy + 0.5) * cell_m
                for iz in range(first[2], last[2] + 1):
                    flat = (ix * shape[1] + iy) * shape[2] + iz
                    z = origin_m[2] + (iz + 0.5) * cell_m
                    if not occupied[flat] and cube_meets_solid(kind, size_m, rotation, translation, s, x, y, z, half_m):
                        occupied[flat] = 1
