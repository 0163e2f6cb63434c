"""The lookup table: cell -> neurons, cell -> edges (beyond their ends' cells), and the live counts that say what is blocked.

The table is a dynamic roadmap's (Leven and Hutchinson 2002) on learned nodes. It is immutable; :class:`BlockedCounts` is the state of one
world (the live one, or that of a question) on top of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import dataclass, field
from queue import SimpleQueue
from typing import Any

import numpy as np
from numpy.typing import NDArray

from common.geometry.grid import Grid
from services.planner.core.layer_table import NO_LAYERS, LayerTable
from services.planner.core.near import NearCounts
from services.planner.core.rows import flat_rows, owners_in, rows_of_flat, transposed
from services.planner.kernels.collision import Arm
from services.planner.kernels.lookup import count_rows, edge_extra_cells, node_cells, take_cells

__all__ = [
    "N_THREADS",
    "BlockedCounts",
    "LookupTable",
    "Progress",
    "Swept",
    "build_table",
    "cells_of_pose",
    "rows_of_owners",
    "sweep",
]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]
U16 = NDArray[np.uint16]

CHUNK = 256  # neurons or edges a kernel call; progress is reported between
MAX_CELLS_A_POSE = 20_000  # our choice; a UR3 pose sweeps about 2 000 cells of 2 cm
N_THREADS = 2  # our choice: the kernels release the interpreter's lock; does not change the table
Progress = Callable[[int, int], None]
RowKernel = Callable[[NDArray[Any], int, I64, I32, I64], int]  # items, first mark, stamp, out cells, offsets -> items done


@dataclass(frozen=True, eq=False)
class LookupTable:
    """Rows of owners by cell, for neurons and for edges.

    Attributes:
        node_offset, node_owner: neurons by cell, as in :mod:`services.planner.core.rows`: offset (pages, n_cells + 1) int64, owners uint16.
        edge_offset, edge_owner: the same for edges; an edge's row holds only what it sweeps beyond its two ends.
        unavoidable: (U,) int32 ascending cells that every neuron sweeps; they are in no row, since no path could ever avoid them.
        layers: which neurons and edges are near a cell beyond the safety distance.
        barred_nodes, barred_edges: int32 ascending; what is blocked whatever the cells: a payload would hit the static layer or the arm.
    """

    node_offset: I64
    node_owner: U16
    edge_offset: I64
    edge_owner: U16
    unavoidable: I32
    layers: LayerTable = NO_LAYERS
    barred_nodes: I32 = field(default_factory=lambda: np.empty(0, dtype=np.int32))
    barred_edges: I32 = field(default_factory=lambda: np.empty(0, dtype=np.int32))

    @staticmethod
    def of_arrays(arrays: Mapping[str, NDArray[Any]], n_cells: int, layers: LayerTable = NO_LAYERS) -> LookupTable:
        """The table of :meth:`arrays`.

        Raises:
            KeyError, ValueError: an array is missing or does not fit.
        """
        return LookupTable(*rows_of_flat(arrays, n_cells), np.asarray(arrays["unavoidable"]), layers)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """All arrays by name, as a file has them, without those of the layers."""
        return {**flat_rows(self.node_offset, self.node_owner, self.edge_offset, self.edge_owner), "unavoidable": self.unavoidable}

    @property
    def n_bytes(self) -> int:
        """Bytes of all arrays, without those of the layers."""
        return sum(a.nbytes for a in (self.node_offset, self.node_owner, self.edge_offset, self.edge_owner, self.unavoidable))

    def neurons_of(self, cell: int) -> I32:
        """Neurons that the cell blocks, ascending."""
        return owners_in(self.node_offset, self.node_owner, cell)

    def edges_of(self, cell: int) -> I32:
        """Edges that the cell blocks beyond those whose ends it blocks, ascending."""
        return owners_in(self.edge_offset, self.edge_owner, cell)


@dataclass(frozen=True, eq=False)
class Swept:
    """Which cells each neuron and each edge sweeps: rows of cells by owner, the table the other way round.

    Attributes:
        node_offset, node_cell: cells of neuron k are ``node_cell[node_offset[k]:node_offset[k + 1]]``, ascending; int64, int32.
        edge_offset, edge_cell: the same for edges, without the cells of their two ends.
    """

    node_offset: I64
    node_cell: I32
    edge_offset: I64
    edge_cell: I32


def sweep(
    arm: Arm,
    grid: Grid,
    neurons_rad: F64,
    edges: I32,
    *,
    safety_m: float,
    step_m: float,
    progress: Progress | None = None,
    n_threads: int = N_THREADS,
) -> Swept:
    """The cells of neurons (N, J) and of the edges (M, 2) between them; arguments as for :func:`build_table`."""
    total = len(neurons_rad) + len(edges)
    geometry = (np.asarray(grid.origin_m), np.asarray(grid.shape, dtype=np.int64), grid.resolution_m, safety_m)

    def run_nodes(part: NDArray[Any], first: int, stamp: I64, out: I32, offset: I64) -> int:
        return int(node_cells(arm, *geometry, part, first, stamp, out, offset))

    def report(done: int) -> None:
        if progress is not None:
            progress(done, total)

    node_offset, node_cell = rows_of_owners(run_nodes, neurons_rad, grid.n_cells, report, n_threads)

    def run_edges(part: NDArray[Any], first: int, stamp: I64, out: I32, offset: I64) -> int:
        return int(edge_extra_cells(arm, *geometry, step_m, neurons_rad, part, node_offset, node_cell, first, stamp, out, offset))

    edge_offset, edge_cell = rows_of_owners(run_edges, edges, grid.n_cells, lambda done: report(len(neurons_rad) + done), n_threads)
    return Swept(node_offset, node_cell, edge_offset, edge_cell)


def build_table(
    arm: Arm, grid: Grid, neurons_rad: F64, edges: I32, *, safety_m: float, step_m: float, progress: Progress | None = None
) -> LookupTable:
    """The table of a map.

    Args:
        arm: the arm as the checks see it.
        grid: the cells.
        neurons_rad: (N, J).
        edges: (M, 2) neuron indices.
        safety_m: inflation of the moving bodies.
        step_m: farthest that any point of the arm moves between two samples of an edge.
        progress: called with (done, total) now and then.
    """
    swept = sweep(arm, grid, neurons_rad, edges, safety_m=safety_m, step_m=step_m, progress=progress)
    counts = np.zeros(grid.n_cells, dtype=np.int64)
    count_rows(swept.node_cell, counts)
    unavoidable = np.flatnonzero(counts == len(neurons_rad)).astype(np.int32) if len(neurons_rad) else np.empty(0, dtype=np.int32)
    return LookupTable(
        *transposed(swept.node_offset, swept.node_cell, grid.n_cells, unavoidable),
        *transposed(swept.edge_offset, swept.edge_cell, grid.n_cells, unavoidable),
        unavoidable=unavoidable,
    )


def rows_of_owners(run: RowKernel, items: NDArray[Any], n_cells: int, report: Callable[[int], None], n_threads: int) -> tuple[I64, I32]:
    """Owner -> cells of all items: offsets (n + 1,) and flat cells. Chunks are worked on by threads and put together in order.

    ``n_cells``: length of the stamps that ``run`` gets.
    """
    scratches: SimpleQueue[tuple[I64, I32]] = SimpleQueue()
    for _ in range(n_threads):
        scratches.put((np.full(n_cells, -1, dtype=np.int64), np.empty(CHUNK * MAX_CELLS_A_POSE, dtype=np.int32)))

    def work(first: int) -> list[tuple[I64, I32]]:
        stamp, buffer = scratches.get()
        rows = _chunk_rows(run, items[first : first + CHUNK], stamp, buffer)
        scratches.put((stamp, buffer))
        return rows

    lengths, cells = [np.zeros(1, dtype=np.int64)], [np.empty(0, dtype=np.int32)]
    executor = ThreadPoolExecutor(n_threads)
    try:
        for k, rows in enumerate(executor.map(work, range(0, len(items), CHUNK))):
            lengths += [row_lengths for row_lengths, _ in rows]
            cells += [row_cells for _, row_cells in rows]
            report(min((k + 1) * CHUNK, len(items)))
    finally:
        executor.shutdown(cancel_futures=True)
    return np.cumsum(np.concatenate(lengths)), np.concatenate(cells)


def _chunk_rows(run: RowKernel, part: NDArray[Any], stamp: I64, buffer: I32) -> list[tuple[I64, I32]]:
    """Row lengths and cells of ``part``, in as many pieces as the buffer needs."""
    pieces, done = [], 0
    while done < len(part):
        stamp.fill(-1)  # an owner that did not fit has left its mark and begins anew
        offset = np.zeros(len(part) - done + 1, dtype=np.int64)
        n = run(part[done:], done, stamp, buffer, offset)
        if n == 0:
            raise ValueError(f"one pose or edge sweeps more than {len(buffer)} cells: the cells are too small for this arm")
        pieces.append((np.diff(offset[: n + 1]), buffer[: offset[n]].copy()))
        done += n
    return pieces


def cells_of_pose(arm: Arm, grid: Grid, q_rad: F64, *, safety_m: float) -> I32:
    """(C,) ascending cells that block one pose (J,): a neuron's row, made on demand; unavoidable ones included."""
    out, offset = np.empty(MAX_CELLS_A_POSE, dtype=np.int32), np.zeros(2, dtype=np.int64)
    stamp = np.full(grid.n_cells, -1, dtype=np.int64)
    shape = np.asarray(grid.shape, dtype=np.int64)
    if node_cells(arm, np.asarray(grid.origin_m), shape, grid.resolution_m, safety_m, q_rad[None], 0, stamp, out, offset) == 0:
        raise ValueError(f"one pose sweeps more than {MAX_CELLS_A_POSE} cells: the cells are too small for this arm")
    return out[: offset[1]].copy()


class BlockedCounts:
    """How many occupied cells block each neuron and each edge: the map's view of one world.

    A neuron is blocked while its count is above zero; an edge while its own count or that of one of its ends is.

    Cells that are enclosed, all 26 around them occupied, are not counted: an arm that reaches one passes through those about it, since it
    is in one piece and stands on cells that are never occupied (``table.unavoidable``). In the questions of the benchmark that is two
    cells in five.

    Args:
        table: of the map. n_neurons, n_edges: of the map.
        shape: of the grid; None: enclosed cells are counted as any.
    """

    def __init__(self, table: LookupTable, n_neurons: int, n_edges: int, shape: tuple[int, int, int] | None = None) -> None:
        self._table = table
        self.node = np.zeros(n_neurons, dtype=np.int32)
        self.edge = np.zeros(n_edges, dtype=np.int32)
        self.near = NearCounts(table.layers, n_neurons, n_edges)
        self.node[table.barred_nodes] = 1  # as if by a cell that never goes
        self.edge[table.barred_edges] = 1
        self.cells: I32 = np.empty(0, dtype=np.int32)
        self._counted: I32 = self.cells
        self._shape = np.zeros(3, dtype=np.int64) if shape is None else np.array(shape, dtype=np.int64)
        leaves_out_enclosed = shape is not None and len(table.unavoidable) > 0  # else not sure of it
        self._occupied = np.zeros(int(np.prod(self._shape + 2)) if leaves_out_enclosed else 0, dtype=np.uint8)

    def set_cells(self, cells: I32) -> tuple[I32, I32]:
        """Make ``cells`` (ascending, unique) the occupied ones; cost follows the difference. Returns (appeared, gone)."""
        t = self._table
        rows = (t.node_offset, t.node_owner, self.node), (t.edge_offset, t.edge_owner, self.edge)
        known = t.unavoidable, self._shape, self._occupied
        appeared, gone, self._counted, more, less = take_cells(self.cells, self._counted, cells, *known, *rows)
        self.near.change(more, less)
        self.cells = cells
        return appeared, gone

    @property
    def n_blocked(self) -> int:
        """Number of blocked neurons."""
        return int(np.count_nonzero(self.node))

    def without(self, cells: I32) -> BlockedCounts:
        """A copy in which ``cells`` (a subset of the occupied ones) count as empty."""
        fewer = copy(self)
        fewer.node, fewer.edge, fewer.near, fewer._occupied = self.node.copy(), self.edge.copy(), self.near.copy(), self._occupied.copy()
        fewer.set_cells(np.setdiff1d(self.cells, cells, assume_unique=True))
        return fewer
