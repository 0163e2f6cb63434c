"""How near a pose is to cells and static layer: a lower bound, exact but for how far a body's cover sticks out of it (8 mm at most).

Twin: ``tests/support/slow_separation.py``; referee: the physics engine.
"""

from __future__ import annotations

import math

import numpy as np

from common.kernel import leaf
from common.robot.body_distance import to_world
from services.planner.kernels.body_cells import ROOT3
from services.planner.kernels.cells import BLOCK
from services.planner.kernels.static_layer import solid_distance

__all__ = ["pose_clearance"]


@leaf
def pose_clearance(arm, solids, cells, rotation, translation):  # type: ignore[no-untyped-def]
    """Lower bound in metres of the distance from the arm, in the pose with these frames, to all cells and to the static layer.

    What stands (``arm.moving`` 0) is measured against cells alone. Zero where a cover touches, infinite if there is nothing.
    """
    grids, half_m = arm.grids, cells.half_m
    best = np.inf
    for b in range(len(arm.moving)):
        j = grids.body_joint[b]
        turn, shift = rotation[j], translation[j]
        for g in range(grids.group_offset[b], grids.group_offset[b + 1]):
            x, y, z = to_world(turn, shift, grids.group_m, g)
            near = best + grids.group_m[g, 3]
            if arm.moving[b]:
                for s in range(len(solids.kind)):
                    if solid_distance(solids.kind, solids.size_m, solids.rotation, solids.translation, s, x, y, z) < near:
                        best = min(best, _spheres_to_solid(grids, solids, g, s, turn, shift))
                        near = best + grids.group_m[g, 3]
            for k in range(len(cells.block_m)):
                dx, dy, dz = cells.block_m[k, 0] - x, cells.block_m[k, 1] - y, cells.block_m[k, 2] - z
                if math.sqrt(dx * dx + dy * dy + dz * dz) - cells.block_m[k, 3] - half_m * ROOT3 >= near:
                    continue
                for i in range(k * BLOCK, min((k + 1) * BLOCK, len(cells.centre_m))):
                    if _to_cube(cells.centre_m, i, half_m, x, y, z) < near:
                        best = min(best, _spheres_to_cube(grids, g, cells.centre_m, i, half_m, turn, shift))
                        near = best + grids.group_m[g, 3]
    return max(best, 0.0)


@leaf
def _to_cube(centre_m, i, half_m, x, y, z):  # type: ignore[no-untyped-def]
    """Distance in metres of a point to cell ``i``; 0 inside."""
    u, v, w = abs(centre_m[i, 0] - x) - half_m, abs(centre_m[i, 1] - y) - half_m, abs(centre_m[i, 2] - z) - half_m
    return math.sqrt(max(u, 0.0) ** 2 + max(v, 0.0) ** 2 + max(w, 0.0) ** 2)


@leaf
def _spheres_to_cube(grids, g, centre_m, i, half_m, turn, shift):  # type: ignore[no-untyped-def]
    nearest = np.inf
    for p in range(grids.group_sphere_offset[g], grids.group_sphere_offset[g + 1]):
        x, y, z = to_world(turn, shift, grids.spheres_m, p)
        nearest = min(nearest, _to_cube(centre_m, i, half_m, x, y, z) - grids.spheres_m[p, 3])
    return nearest


@leaf
def _spheres_to_solid(grids, solids, g, s, turn, shift):  # type: ignore[no-untyped-def]
    nearest = np.inf
    for p in range(grids.group_sphere_offset[g], grids.group_sphere_offset[g + 1]):
        x, y, z = to_world(turn, shift, grids.spheres_m, p)
        gap = solid_distance(solids.kind, solids.size_m, solids.rotation, solids.translation, s, x, y, z) - grids.spheres_m[p, 3]
        nearest = min(nearest, gap)
    return nearest
