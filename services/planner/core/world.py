"""What the planner checks against: the arm, the static layer, and the cells of the moment, as arrays for the kernels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from common.cell import SolidConfig
from common.geometry.grid import Grid
from common.geometry.transforms import rpy_matrix
from common.robot.model import RobotModel
from services.planner.kernels.collision import BLOCK, BOX, CYLINDER, SPHERE, Arm, Cells, Solids, block_bounds

__all__ = ["arm_of", "cells_of", "no_cells", "solids_of"]

I32 = NDArray[np.int32]


def arm_of(robot: RobotModel, *, static_margin_m: float, self_margin_m: float) -> Arm:
    """The arm as the checks see it; immobile bodies stand in the world and are left out against cells and static layer."""
    return Arm(
        chain=robot.chain,
        grids=robot.grids,
        moving=np.array([not body.immobile for body in robot.bodies], dtype=np.uint8),
        pairs=robot.pairs,
        static_margin_m=float(static_margin_m),
        self_margin_m=float(self_margin_m),
    )


def solids_of(static: Sequence[SolidConfig]) -> Solids:
    """The static layer as arrays."""
    kinds = {"box": BOX, "sphere": SPHERE, "cylinder": CYLINDER}
    n = len(static)
    size, rotation, translation = np.zeros((n, 3)), np.zeros((n, 3, 3)), np.zeros((n, 3))
    for i, solid in enumerate(static):
        T = rpy_matrix(solid.position_m, solid.rpy_rad)
        rotation[i], translation[i] = T[:3, :3], T[:3, 3]
        if solid.shape == "box":
            size[i] = np.asarray(solid.size_m) / 2.0
        elif solid.shape == "cylinder":
            size[i, :2] = solid.size_m[0], solid.size_m[1] / 2.0
        else:
            size[i, 0] = solid.size_m[0]
    return Solids(np.array([kinds[s.shape] for s in static], dtype=np.int64), size, rotation, translation)


def cells_of(grid: Grid, cells: I32) -> Cells:
    """Flat cell indices (C,) as centres with block bounds; ascending indices make compact blocks."""
    centre = np.ascontiguousarray(grid.centres(cells))
    block = np.empty((-(-len(centre) // BLOCK), 4))
    block_bounds(centre, block)
    return Cells(centre, block, grid.resolution_m / 2.0)


def no_cells(grid: Grid) -> Cells:
    """An empty world."""
    return cells_of(grid, np.empty(0, dtype=np.int32))
