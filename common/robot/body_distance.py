"""Distances from the spheres that cover a body: to another body of the arm, and to points beyond a distance grid's reach."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from common.robot.kernels import body_grid, look_up

__all__ = ["cover_distance", "pair_distance", "to_world"]


@njit(cache=True, nogil=True)
def pair_distance(grids, a, b, rotation, translation, enough_m):  # type: ignore[no-untyped-def]
    """Lower bound in metres of the distance between bodies ``a`` and ``b`` (negative: overlap), at most ``enough_m``.

    The spheres of the body that has fewer groups are looked up in the other's grid, group by group; groups that are farther than
    ``enough_m`` are not looked into, and ``enough_m`` is the answer if all are. What is farther than ``FAR`` from the other body counts as
    just that far. ``rotation`` (J + 1, 3, 3), ``translation`` (J + 1, 3): frames.
    """
    if grids.group_offset[a + 1] - grids.group_offset[a] > grids.group_offset[b + 1] - grids.group_offset[b]:
        a, b = b, a
    ja, jb = grids.body_joint[a], grids.body_joint[b]
    cx, cy, cz = to_world(rotation[ja], translation[ja], grids.bound_centre_m, a)
    dx, dy, dz = to_world(rotation[jb], translation[jb], grids.bound_centre_m, b)
    apart = math.sqrt((cx - dx) ** 2 + (cy - dy) ** 2 + (cz - dz) ** 2)
    if apart - grids.bound_radius_m[a] - grids.bound_radius_m[b] > enough_m:
        return enough_m
    turn, shift = _relative(rotation[ja], translation[ja], rotation[jb], translation[jb])
    best = enough_m
    distance, grid = grids.distance, body_grid(grids, b)
    groups, spheres, first = grids.group_m, grids.spheres_m, grids.group_sphere_offset
    for g in range(grids.group_offset[a], grids.group_offset[a + 1]):
        x, y, z = to_world(turn, shift, groups, g)
        if look_up(distance, grid, x, y, z) - groups[g, 3] >= best:
            continue
        for s in range(first[g], first[g + 1]):
            x, y, z = to_world(turn, shift, spheres, s)
            best = min(best, look_up(distance, grid, x, y, z) - spheres[s, 3])
    return best


@njit(cache=True, nogil=True)
def cover_distance(grids, b, x, y, z, enough_m):  # type: ignore[no-untyped-def]
    """Lower bound in metres of the distance from body ``b`` to a point in its joint frame, at most ``enough_m``.

    At any range, unlike the distance grids; coarser than they are by how far the spheres stick out.
    """
    groups, spheres, first = grids.group_m, grids.spheres_m, grids.group_sphere_offset
    best = enough_m
    for g in range(grids.group_offset[b], grids.group_offset[b + 1]):
        if _to_sphere(groups, g, x, y, z) >= best:
            continue
        for s in range(first[g], first[g + 1]):
            best = min(best, _to_sphere(spheres, s, x, y, z))
    return best


@njit(cache=True, nogil=True, inline="always")
def _to_sphere(spheres, i, x, y, z):  # type: ignore[no-untyped-def]
    dx, dy, dz = spheres[i, 0] - x, spheres[i, 1] - y, spheres[i, 2] - z
    return math.sqrt(dx * dx + dy * dy + dz * dz) - spheres[i, 3]


@njit(cache=True, nogil=True)
def _relative(rotation_a, translation_a, rotation_b, translation_b):  # type: ignore[no-untyped-def]
    """Pose of frame a in frame b: rotation (3, 3), translation (3,)."""
    turn, shift = np.empty((3, 3)), np.empty(3)
    for r in range(3):
        shift[r] = 0.0
        for k in range(3):
            shift[r] += rotation_b[k, r] * (translation_a[k] - translation_b[k])
            turn[r, k] = rotation_b[0, r] * rotation_a[0, k] + rotation_b[1, r] * rotation_a[1, k] + rotation_b[2, r] * rotation_a[2, k]
    return turn, shift


@njit(cache=True, nogil=True, inline="always")
def to_world(rotation, translation, points, i):  # type: ignore[no-untyped-def]
    """Row ``i`` of ``points`` (n, 3 or more), given in the frame with pose ``rotation`` (3, 3), ``translation`` (3,), in the world.

    The row is indexed here and not sliced by the caller: a slice of an array costs numba a reference count.
    """
    x, y, z = points[i, 0], points[i, 1], points[i, 2]
    return (
        translation[0] + rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z,
        translation[1] + rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z,
        translation[2] + rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z,
    )
