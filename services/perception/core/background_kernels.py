"""Numba kernels of the known background. Twins: ``tests/support/slow_perception.py``."""

from __future__ import annotations

import math

from common.kernel import leaf

__all__ = ["BOX", "CYLINDER", "LARGEST_BOUND_M", "SPHERE", "flag_near_solids", "is_solid", "is_table", "solid_distance"]

BOX, SPHERE, CYLINDER = 0, 1, 2
# Noise bounds are cut here: beyond, a surface is too badly seen to be used; 3 sigma at 2.4 m. Our choice.
LARGEST_BOUND_M = 0.06


@leaf
def solid_distance(kind, size_x, size_y, size_z, x, y, z):  # type: ignore[no-untyped-def]
    """Signed distance in metres (negative inside) of a point in the solid's frame; sizes as in :class:`common.cell.SolidConfig`."""
    if kind == SPHERE:
        return math.sqrt(x * x + y * y + z * z) - size_x
    if kind == CYLINDER:
        a, b, c = math.sqrt(x * x + y * y) - size_x, abs(z) - size_y * 0.5, -math.inf
    else:
        a, b, c = abs(x) - size_x * 0.5, abs(y) - size_y * 0.5, abs(z) - size_z * 0.5
    outside = math.sqrt(max(a, 0.0) ** 2 + max(b, 0.0) ** 2 + max(c, 0.0) ** 2)
    return outside + min(max(a, b, c), 0.0)


@leaf
def _near_solid(solids, bound_m, x, y, z):  # type: ignore[no-untyped-def]
    """Whether a point is in a solid or nearer than ``bound_m`` to one."""
    for s in range(len(solids)):
        a, b, c = x - solids[s, 13], y - solids[s, 14], z - solids[s, 15]
        distance = solid_distance(
            solids[s, 0],
            solids[s, 1],
            solids[s, 2],
            solids[s, 3],
            solids[s, 4] * a + solids[s, 7] * b + solids[s, 10] * c,
            solids[s, 5] * a + solids[s, 8] * b + solids[s, 11] * c,
            solids[s, 6] * a + solids[s, 9] * b + solids[s, 12] * c,
        )
        if distance < bound_m:
            return True
    return False


@leaf
def flag_near_solids(solids, centres_m, reach_m, near):  # type: ignore[no-untyped-def]
    """Fill ``near`` (C,): 1 where a cell centre (C, 3) is nearer than ``reach_m`` to one of ``solids`` (S, 16)."""
    for c in range(len(centres_m)):
        near[c] = _near_solid(solids, reach_m, centres_m[c, 0], centres_m[c, 1], centres_m[c, 2])


@leaf
def is_table(rules, z, depth_m, sigma_m, camera_z):  # type: ignore[no-untyped-def]
    """Whether a point measured at height ``z`` and depth ``depth_m`` by a camera at height ``camera_z`` is the table, or below it."""
    # The ray's slope is |camera_z - z| / depth; multiplied through by the depth, because a division costs more than all the rest.
    bound = max(rules.sigmas * depth_m, rules.plane_sigmas * abs(camera_z - z)) * sigma_m
    return (z - rules.table_z_m) * depth_m < min(bound, LARGEST_BOUND_M * depth_m)


@leaf
def is_solid(rules, solids, near, cell, x, y, z, sigma_m):  # type: ignore[no-untyped-def]
    """Whether a measured point is bolted down; ``cell``: flat index of its cell, ``near``: of ``Background``."""
    return near[cell] != 0 and _near_solid(solids, min(rules.sigmas * sigma_m, LARGEST_BOUND_M), x, y, z)
