"""Distance to the bodies of the arm farther out than the fine grids tell: coarser grids that reach over all layers of clearance.

Beyond a safety distance a centimetre matters little, so these voxels are twice as wide. Every answer is a lower bound, as of the fine
grids. Twin: ``tests/support/slow_layers.py``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from common.kernel import kernel, leaf
from common.robot.body_distance import cover_distance
from common.robot.kernels import FAR, BodyGrids, body_grid, look_up

__all__ = ["REACH_SPACING_M", "Reach", "look_far", "reach_grid", "reach_of"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

REACH_SPACING_M = 0.01  # our choice: the grids of a UR3 are 3 MB then
A_METRE = 1.0 / REACH_SPACING_M  # voxels
TENTH_MM = 1e-4  # unit of the stored distances


class Reach(NamedTuple):
    """Distance grids of B bodies; a voxel stores a lower bound of the distance of all its points, in tenths of a millimetre."""

    far_m: float  # answered beyond a grid: a lower bound there, too
    origin_m: F64  # (B, 3) lowest corner
    shape: I64  # (B, 3)
    offset: I64  # (B + 1,) into distance
    distance: NDArray[np.int16]  # flat, x slowest


@leaf
def reach_grid(reach, b):  # type: ignore[no-untyped-def]
    """The scalars of body ``b``'s grid for :func:`look_far`, fetched once before a loop."""
    return (
        reach.offset[b],
        reach.origin_m[b, 0],
        reach.origin_m[b, 1],
        reach.origin_m[b, 2],
        reach.shape[b, 0],
        reach.shape[b, 1],
        reach.shape[b, 2],
        reach.far_m,
    )


@leaf
def look_far(distance, grid, x, y, z):  # type: ignore[no-untyped-def]
    """Lower bound in metres of the distance of a point in the body's joint frame; ``far_m`` beyond the grid.

    ``distance``: :attr:`Reach.distance`; ``grid``: :func:`reach_grid` of the body.
    """
    fx, fy, fz = (x - grid[1]) * A_METRE, (y - grid[2]) * A_METRE, (z - grid[3]) * A_METRE
    if not (0.0 <= fx < grid[4] and 0.0 <= fy < grid[5] and 0.0 <= fz < grid[6]):
        return grid[7]
    return distance[grid[0] + (int(fx) * grid[5] + int(fy)) * grid[6] + int(fz)] * TENTH_MM


def reach_of(grids: BodyGrids, far_m: float) -> Reach:
    """Grids that tell distances up to ``far_m`` from the fine grids and sphere covers of all bodies; a quarter of a second for a UR3."""
    room_m = far_m + REACH_SPACING_M  # so that what lies beyond a grid is farther than far_m
    origin = grids.box_min_m - room_m
    shape = np.ceil((grids.box_max_m + room_m - origin) / REACH_SPACING_M).astype(np.int64)
    offset = np.concatenate([[0], np.cumsum(shape.prod(axis=1))]).astype(np.int64)
    distance = np.empty(offset[-1], dtype=np.int16)
    for b in range(len(shape)):
        _fill(grids, b, origin[b], shape[b], far_m, distance[offset[b] : offset[b + 1]])
    return Reach(far_m, origin, shape, offset, distance)


@kernel
def _fill(grids, b, origin_m, shape, far_m, distance):  # type: ignore[no-untyped-def]
    """Fill ``distance`` of body ``b``: from lower bounds at the voxels' corners to one for all points of each voxel.

    To the surface point nearest to a point p of a voxel, some corner is nearer than the root of d(p)^2 + 3/4 h^2: along each axis the one
    on that side, or where both are as good the closer one, at most half an edge off. Solved for d(p). Near or inside a body a distance
    still changes by no more than the way gone.
    """
    nx, ny, nz = shape
    h = REACH_SPACING_M
    corner = np.empty((nx + 1, ny + 1, nz + 1))
    fine = body_grid(grids, b)
    for i in range(nx + 1):
        for j in range(ny + 1):
            for k in range(nz + 1):
                x, y, z = origin_m[0] + i * h, origin_m[1] + j * h, origin_m[2] + k * h
                d = look_up(grids.distance, fine, x, y, z)
                if d >= FAR:
                    d = max(FAR, cover_distance(grids, b, x, y, z, far_m + 2.0 * h))
                corner[i, j, k] = d
    half = 0.5 * math.sqrt(3.0) * h
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                d = corner[i : i + 2, j : j + 2, k : k + 2].min()
                d = math.sqrt(d * d - half * half) if d > half else d - half
                distance[(i * ny + j) * nz + k] = math.floor(min(d, far_m) / TENTH_MM)
