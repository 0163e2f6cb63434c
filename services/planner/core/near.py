"""What is near the neurons and edges of a map now: the live side of the layers of clearance."""

from __future__ import annotations

from copy import copy
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from services.planner.core.layer_table import LayerTable, Sets
from services.planner.kernels.near import WORD_BITS, Blocks, Rows, change_near

__all__ = ["Near", "NearCounts"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]
U16 = NDArray[np.uint16]
U8 = NDArray[np.uint8]


class Near(NamedTuple):
    """What the searches are told of clearance."""

    node: U8  # (N,) the lowest band of a neuron in which a block is occupied; L: in none
    edge: U8  # (M,) of an edge, by blocks that are nearer to it than to its ends
    factor: F64  # (L + 1,) by band, how many times an edge in it costs its length; empty: all cost their length


class NearCounts:
    """In which band of each neuron and edge the nearest occupied block lies: the layers' view of one world.

    Cost follows the blocks that become occupied or empty; once one becomes empty, also all that are occupied, a little.

    Args:
        table: the layers. n_neurons, n_edges: of the map.
    """

    def __init__(self, table: LayerTable, n_neurons: int, n_edges: int) -> None:
        self._table = table
        n_cells, occupied, place = np.zeros((3, table.n_blocks), dtype=np.int32)
        self._blocks = Blocks(table.cells_shape, table.block_cells, n_cells, occupied, place, np.zeros(1, dtype=np.int64))
        self._nodes = _nothing_near(table.node_offset, table.node_owner, table.node_sets, table.n_bands, n_neurons)
        self._edges = _nothing_near(table.edge_offset, table.edge_owner, table.edge_sets, table.n_bands, n_edges)

    @property
    def node(self) -> U8:
        """(N,) the lowest band of each neuron in which a block is occupied; L: in none."""
        return self._nodes.nearest

    @property
    def edge(self) -> U8:
        """(M,) the same of each edge, by blocks that are nearer to it than to its ends."""
        return self._edges.nearest

    def change(self, appeared: I32, gone: I32) -> None:
        """Cells that appeared and cells that are gone, each (n,) int32."""
        if self._table.n_bands > 0:
            change_near(appeared, gone, self._blocks, self._nodes, self._edges)

    def copy(self) -> NearCounts:
        """The same counts, to be changed independently."""
        twin, b = copy(self), self._blocks
        twin._blocks = b._replace(n_cells=b.n_cells.copy(), occupied=b.occupied.copy(), place=b.place.copy(), n=b.n.copy())
        twin._nodes, twin._edges = (
            r._replace(joined=r.joined.copy(), n_blocks=r.n_blocks.copy(), nearest=r.nearest.copy(), clear=r.clear.copy())
            for r in (self._nodes, self._edges)
        )
        return twin


def _nothing_near(offset: I64, owner: U16, sets: Sets, n_bands: int, n_owners: int) -> Rows:
    joined = np.zeros((n_bands, len(sets.number) * sets.words.shape[1]), dtype=np.uint64)
    n_blocks = np.zeros((n_bands, n_owners), dtype=np.int32)
    clear = np.empty(max(joined.shape[1] * WORD_BITS, n_owners), dtype=np.uint8)  # sets may end before the last owner
    return Rows(offset, owner, sets.number, sets.words, joined, n_blocks, np.full(n_owners, n_bands, dtype=np.uint8), clear)
