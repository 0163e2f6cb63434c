"""What the planner plans in: the arm, the static layer, and the cells of the moment with what they block."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.cell import SolidConfig
from common.geometry.grid import Grid
from common.geometry.transforms import rpy_matrix
from common.robot.model import RobotModel
from services.planner.core.check import Checker
from services.planner.core.lookup import BlockedCounts
from services.planner.kernels.collision import BLOCK, BOX, CYLINDER, FREE, SPHERE, Arm, Cells, Solids, block_bounds
from services.planner.kernels.path import leaves

__all__ = ["Leaving", "World", "arm_of", "cells_of", "no_cells", "solids_of"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
LEAVING_POSES = 40  # poses at which a straight way out is looked at; our choice
LEAVING_SLACK_M = 0.006  # the distance grids answer by voxels of 5 mm: along a way out they go up and down by one


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
        return World(grid, counts, cells_of(grid, counts.cells), cells_of(grid, np.empty(0, dtype=np.int32) if recent is None else recent))

    def leaving(self, checker: Checker, q_start: F64) -> Leaving | None:
        """How an arm that stands within the safety distance of some cells may get out; None if it may not.

        Those cells are tolerated for the way out as long as no cell's middle is in the bare arm (a hand came close, and what is seen of
        it is a cell thicker than it is); what else blocks the start (static layer, the arm itself) cannot be left that way.
        """
        near = checker.cells_hit(self.cells, q_start)
        tolerated = self.counts.cells[near]
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
