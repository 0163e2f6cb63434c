"""Distance between two bodies of the arm: the spheres of one in the distance grid of the other."""

from __future__ import annotations

import math

from numba import njit

from common.robot.kernels import FAR, body_distance, to_joint_frame

__all__ = ["pair_distance", "to_world"]


@njit(cache=True, nogil=True)
def pair_distance(grids, a, b, rotation, translation):  # type: ignore[no-untyped-def]
    """Lower bound in metres of the distance between bodies ``a`` and ``b`` (negative: overlap); ``FAR`` when out of the grids' reach.

    The spheres of the body that has fewer groups are looked up in the other's grid, group by group. ``rotation`` (J + 1, 3, 3),
    ``translation`` (J + 1, 3): frames. What is farther than ``FAR`` from the other body counts as just that far, so the answer never
    exceeds ``FAR`` less the radius of a sphere.
    """
    if grids.group_offset[a + 1] - grids.group_offset[a] > grids.group_offset[b + 1] - grids.group_offset[b]:
        a, b = b, a
    ja, jb = grids.body_joint[a], grids.body_joint[b]
    best = FAR
    cx, cy, cz = to_world(rotation[ja], translation[ja], grids.bound_centre_m[a])
    dx, dy, dz = to_world(rotation[jb], translation[jb], grids.bound_centre_m[b])
    apart = math.sqrt((cx - dx) ** 2 + (cy - dy) ** 2 + (cz - dz) ** 2)
    if apart - grids.bound_radius_m[a] - grids.bound_radius_m[b] > FAR:
        return best
    for g in range(grids.group_offset[a], grids.group_offset[a + 1]):
        x, y, z = to_world(rotation[ja], translation[ja], grids.group_m[g])
        x, y, z = to_joint_frame(rotation[jb], translation[jb], x, y, z)
        if body_distance(grids, b, x, y, z) - grids.group_m[g, 3] >= best:
            continue
        for s in range(grids.group_sphere_offset[g], grids.group_sphere_offset[g + 1]):
            x, y, z = to_world(rotation[ja], translation[ja], grids.spheres_m[s])
            x, y, z = to_joint_frame(rotation[jb], translation[jb], x, y, z)
            best = min(best, body_distance(grids, b, x, y, z) - grids.spheres_m[s, 3])
    return best


@njit(cache=True, nogil=True, inline="always")
def to_world(rotation, translation, p):  # type: ignore[no-untyped-def]
    """Point ``p`` (3+,) of the frame with pose ``rotation`` (3, 3), ``translation`` (3,) in the world."""
    return (
        translation[0] + rotation[0, 0] * p[0] + rotation[0, 1] * p[1] + rotation[0, 2] * p[2],
        translation[1] + rotation[1, 0] * p[0] + rotation[1, 1] * p[1] + rotation[1, 2] * p[2],
        translation[2] + rotation[2, 0] * p[0] + rotation[2, 1] * p[1] + rotation[2, 2] * p[2],
    )
