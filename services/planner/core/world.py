"""What the planner plans in: the cells of the moment with what they block."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from common.geometry.grid import Grid
from services.planner.core.check import Checker
from services.planner.core.lookup import BlockedCounts
from services.planner.kernels.cells import Cells, arrange_cells
from services.planner.kernels.collision import FREE
from services.planner.kernels.path import leaves

__all__ = ["Leaving", "World", "cells_of", "no_cells"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
LEAVING_POSES = 40  # poses at which a straight way out is looked at; our choice
LEAVING_SLACK_M = 0.006  # the distance grids answer by voxels of 5 mm: along a way out they go up and down by one


def cells_of(grid: Grid, cells: I32) -> Cells:
    """Flat cell indices (C,) as the checks see them."""
    flat, centre_m, block_m, group_m = arrange_cells(cells, grid.origin_m, grid.shape, grid.resolution_m)
    return Cells(flat, centre_m, block_m, group_m, grid.resolution_m / 2.0)


@cache
def no_cells(grid: Grid) -> Cells:
    """An empty world."""
    return cells_of(grid, np.empty(0, dtype=np.int32))


@dataclass(frozen=True, eq=False)
class World:
    """The occupied cells of one moment: as counts on the map and as geometry; ``recent``: those that may belong to something that moves."""

    grid: Grid
    counts: BlockedCounts
    cells: Cells
    recent: Cells

    @staticmethod
    def of(grid: Grid, counts: BlockedCounts, recent: I32 | None = None) -> World:
        """The world that ``counts`` were last set to; ``recent`` (n,) flat cells that just appeared."""
        return World(grid, counts, cells_of(grid, counts.cells), no_cells(grid) if recent is None else cells_of(grid, recent))

    def frozen(self) -> World:
        """A copy that does not change with the live counts."""
        return World(self.grid, self.counts.without(np.empty(0, dtype=np.int32)), self.cells, self.recent)

    def leaving(self, checker: Checker, q_start: F64) -> Leaving | None:
        """How an arm that stands within the safety distance of some cells may get out; None if it may not.

        Those cells are tolerated for the way out as long as no cell's middle is in the bare arm (a hand came close, and what is seen of
        it is a cell thicker than it is); what else blocks the start (static layer, the arm itself) cannot be left that way.
        """
        near = checker.cells_hit(self.cells, q_start)
        tolerated = np.sort(self.cells.flat[near])
        if not near.any() or checker.cells_hit(self.cells, q_start, safety_m=-self.cells.half_m).any():
            return None
        rest = World.of(self.grid, self.counts.without(tolerated))
        if checker.pose(rest.cells, q_start)[0] != FREE:
            return None
        return Leaving(cells_of(self.grid, tolerated), rest)


@dataclass(frozen=True, eq=False)
class Leaving:
    """Cells tolerated on the way out, and the world without them."""

    tolerated: Cells
    rest: World

    def is_way_out(self, checker: Checker, q_from: F64, q_to: F64) -> bool:
        """Whether the straight way never goes deeper into the tolerated cells."""
        return self.leads_out(checker, np.linspace(q_from, q_to, LEAVING_POSES))

    def leads_out(self, checker: Checker, poses_rad: F64) -> bool:
        """Whether the arm only moves away from the tolerated cells along ``poses_rad`` (K, J)."""
        reach_m = checker.safety_m + self.tolerated.half_m * np.sqrt(3.0)
        return bool(leaves(checker.arm, self.tolerated, reach_m, LEAVING_SLACK_M, poses_rad))
