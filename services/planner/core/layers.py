"""Making the layers of clearance: rules in a :class:`LayerRules`, rows as of the lookup table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from common.geometry.grid import Grid
from services.planner.core.layer_table import LayerTable
from services.planner.core.lookup import N_THREADS, Progress, Swept, rows_of_owners
from services.planner.core.rows import rows_of_flat, transposed
from services.planner.kernels.body_cells import ROOT3
from services.planner.kernels.collision import Arm
from services.planner.kernels.layers import edge_bands, node_bands
from services.planner.kernels.reach import Reach, reach_of

__all__ = ["LayerRules", "build_layers", "near_blocks"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]
U16 = NDArray[np.uint16]
ROUNDING_M = 1e-3  # the far grids reach so much beyond what is asked of them


@dataclass(frozen=True, eq=False)
class LayerRules:
    """What the rows of the layers depend on besides the map.

    Attributes:
        arm: the arm.
        cells_shape: (3,) int64, the grid of cells; block_cells: cells along a block's edge.
        origin_m: (3,); block_m: edge of a block.
        beyond_m, within_m: (L,) distance of each layer beyond the safety distance, and from the bare arm.
        step_m: farthest that any point of the arm moves between two samples of an edge.
    """

    arm: Arm
    cells_shape: I64
    block_cells: int
    origin_m: F64
    block_m: float
    beyond_m: F64
    within_m: F64
    step_m: float

    @staticmethod
    def of(arm: Arm, grid: Grid, layers_m: Sequence[float], block_m: float, *, safety_m: float, step_m: float) -> LayerRules:
        """Rules for layers at ``layers_m`` (L >= 1) beyond the safety distance in blocks of about ``block_m`` (a whole number of cells)."""
        block_cells = max(1, round(block_m / grid.resolution_m))
        edge_m = block_cells * grid.resolution_m
        beyond_m = np.array(layers_m, dtype=np.float64)
        shape = np.asarray(grid.shape, dtype=np.int64)
        return LayerRules(arm, shape, block_cells, np.asarray(grid.origin_m), edge_m, beyond_m, beyond_m + safety_m, step_m)

    @cached_property
    def reach(self) -> Reach:
        """Distance grids of the bodies that reach over all layers."""
        return reach_of(self.arm.grids, float(self.within_m[-1]) + self.block_m / 2.0 * ROOT3 + ROUNDING_M)

    @property
    def blocks(self) -> tuple[F64, I64, float]:
        """Origin, shape and edge of the blocks, for the kernels."""
        return self.origin_m, -(-self.cells_shape // self.block_cells), self.block_m

    @property
    def n_entries(self) -> int:
        """Number of rows: blocks times bands."""
        return int(np.prod(self.blocks[1])) * len(self.within_m)

    def table(self, nodes: tuple[I64, U16], edges: tuple[I64, U16]) -> LayerTable:
        """The table of rows by entry, (offset, owner) for neurons and for edges."""
        return LayerTable(self.beyond_m, self.cells_shape, self.block_cells, *nodes, *edges)

    def table_of_arrays(self, arrays: Mapping[str, NDArray[Any]]) -> LayerTable:
        """The table of :meth:`LayerTable.arrays`.

        Raises:
            KeyError, ValueError: an array is missing or does not fit.
        """
        return LayerTable(self.beyond_m, self.cells_shape, self.block_cells, *rows_of_flat(arrays, self.n_entries))


def near_blocks(rules: LayerRules, neurons_rad: F64, edges: I32, *, progress: Progress | None = None, n_threads: int = N_THREADS) -> Swept:
    """Entries of neurons (N, J) and of edges (M, 2) between them, rows by owner; ``progress`` is called with (done, total)."""
    total, n_stamps = len(neurons_rad) + len(edges), 2 * int(np.prod(rules.blocks[1]))
    geometry = (rules.arm, rules.reach, rules.blocks, rules.within_m)

    def report(done: int) -> None:
        if progress is not None:
            progress(done, total)

    def run_nodes(part: NDArray[Any], first: int, stamp: I64, out: I32, offset: I64) -> int:
        return int(node_bands(*geometry, part, first, stamp, out, offset))

    node_offset, node_entry = rows_of_owners(run_nodes, neurons_rad, n_stamps, report, n_threads)

    def run_edges(part: NDArray[Any], first: int, stamp: I64, out: I32, offset: I64) -> int:
        ends = (neurons_rad, part, node_offset, node_entry)
        return int(edge_bands(*geometry, rules.step_m, *ends, first, stamp, out, offset))

    edge_offset, edge_entry = rows_of_owners(run_edges, edges, n_stamps, lambda done: report(len(neurons_rad) + done), n_threads)
    return Swept(node_offset, node_entry, edge_offset, edge_entry)


def build_layers(rules: LayerRules, neurons_rad: F64, edges: I32, progress: Progress | None = None) -> LayerTable:
    """The layers of a map; arguments as for :func:`near_blocks`."""
    near = near_blocks(rules, neurons_rad, edges, progress=progress)
    none = np.empty(0, dtype=np.int32)
    return rules.table(
        transposed(near.node_offset, near.node_cell, rules.n_entries, none),
        transposed(near.edge_offset, near.edge_cell, rules.n_entries, none),
    )
