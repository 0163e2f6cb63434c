"""A scene of solids as the cells that a camera without any fault would see: all that a solid touches."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from common.cell import SolidConfig
from common.geometry.grid import Grid
from services.planner.core.arm import placed_solids, world_reach_m
from services.planner.kernels.solid_cells import mark_solid_cells

__all__ = ["solid_cells"]

I32 = NDArray[np.int32]


def solid_cells(grid: Grid, solids: Sequence[SolidConfig]) -> I32:
    """(C,) ascending flat indices of the cells that a solid overlaps; exact, what lies outside the grid is left out."""
    occupied = np.zeros(grid.n_cells, dtype=np.uint8)
    if solids:
        kind, size, rotation, translation = placed_solids(solids)
        origin, shape = np.asarray(grid.origin_m), np.asarray(grid.shape, dtype=np.int64)
        reach = world_reach_m(solids, rotation)
        mark_solid_cells(kind, size, rotation, translation, reach, origin, shape, grid.resolution_m, occupied)
    return np.flatnonzero(occupied).astype(np.int32)
