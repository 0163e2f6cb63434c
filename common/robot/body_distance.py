"""Distances from the spheres that cover a body: to another body of the arm, and to points beyond a distance grid's reach."""

from __future__ import annotations

import math

import numpy as np

from common.kernel import inlined, leaf
from common.robot.kernels import body_grid, look_close, look_near, to_joint_frame

__all__ = ["cover_distance", "pair_distance", "to_parts", "to_world"]

AMPLE_M = 0.05  # our choice


@inlined
def pair_distance(grids, a, b, rotation, translation, fine_m):  # type: ignore[no-untyped-def]
    """Lower bound in metres of the distance between bodies ``a`` and ``b`` (negative: overlap).

    The spheres of the body that has fewer groups are looked up in the other's grid, group by group. Bodies and groups that are more than
    ``fine_m`` apart (by the spheres that contain them, by the grid) are not looked into: the bound is coarser there, and coarsest where two
    spheres about the bodies leave ``AMPLE_M`` more.
    ``rotation`` (J + 1, 3, 3), ``translation`` (J + 1, 3): frames.
    """
    if grids.group_offset[a + 1] - grids.group_offset[a] > grids.group_offset[b + 1] - grids.group_offset[b]:
        a, b = b, a
    ja, jb = grids.body_joint[a], grids.body_joint[b]
    turn_a, shift_a, turn_b, shift_b = rotation[ja], translation[ja], rotation[jb], translation[jb]
    ax, ay, az = to_world(turn_a, shift_a, grids.bound_centre_m, a)
    bx, by, bz = to_world(turn_b, shift_b, grids.bound_centre_m, b)
    apart = math.sqrt((ax - bx) ** 2 + (ay - by) ** 2 + (az - bz) ** 2) - grids.bound_radius_m[a] - grids.bound_radius_m[b]
    if apart > fine_m + AMPLE_M:
        return apart
    apart = np.inf
    for p in range(grids.part_offset[a], grids.part_offset[a + 1]):
        x, y, z = to_world(turn_a, shift_a, grids.part_m, p)
        x, y, z = to_joint_frame(turn_b, shift_b, x, y, z)
        apart = min(apart, to_parts(grids, b, x, y, z) - grids.part_m[p, 3])
    if apart > fine_m:
        return apart
    best = np.inf
    distance, grid = grids.distance, body_grid(grids, b)
    groups, spheres, first = grids.group_m, grids.spheres_m, grids.group_sphere_offset
    for g in range(grids.group_offset[a], grids.group_offset[a + 1]):
        x, y, z = to_world(turn_a, shift_a, groups, g)
        x, y, z = to_joint_frame(turn_b, shift_b, x, y, z)
        apart = look_near(distance, grid, x, y, z) - groups[g, 3]
        if apart > fine_m:
            best = min(best, apart)
            continue
        for s in range(first[g], first[g + 1]):
            x, y, z = to_world(turn_a, shift_a, spheres, s)
            x, y, z = to_joint_frame(turn_b, shift_b, x, y, z)
            reach = fine_m + spheres[s, 3]
            best = min(best, look_close(distance, grid, x, y, z, -1.0, reach) - spheres[s, 3])
    return best


@leaf
def to_parts(grids, b, x, y, z):  # type: ignore[no-untyped-def]
    """Coarse lower bound in metres of the distance from a point in body ``b``'s joint frame to it, at any range."""
    nearest = np.inf
    for p in range(grids.part_offset[b], grids.part_offset[b + 1]):
        nearest = min(nearest, _to_sphere(grids.part_m, p, x, y, z))
    return nearest


@leaf
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


@leaf
def _to_sphere(spheres, i, x, y, z):  # type: ignore[no-untyped-def]
    dx, dy, dz = spheres[i, 0] - x, spheres[i, 1] - y, spheres[i, 2] - z
    return math.sqrt(dx * dx + dy * dy + dz * dz) - spheres[i, 3]


@leaf
def to_world(rotation, translation, points, i):  # type: ignore[no-untyped-def]
    """Row ``i`` of ``points`` (n, 3 or more), given in the frame with pose ``rotation`` (3, 3), ``translation`` (3,), in the world."""
    x, y, z = points[i, 0], points[i, 1], points[i, 2]
    return (
        translation[0] + rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z,
        translation[1] + rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z,
        translation[2] + rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z,
    )
