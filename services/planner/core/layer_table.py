"""The layers of a lookup table: block of cells -> neurons and edges near it, by bands of distance; and how many are near now.

Layers are of blocks and not of cells, since a volume grows with its width: in cells of 2 cm the layers up to 10 cm beyond the safety
distance would have about eight times as many entries as in blocks of 4 cm, in which they are as large as the table itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from services.planner.core.rows import flat_rows, owners_in
from services.planner.kernels.layers import change_layers

__all__ = ["NO_LAYERS", "LayerTable", "Near", "NearCounts", "most_blocks"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]
U16 = NDArray[np.uint16]
U64 = NDArray[np.uint64]
WORD_BITS = 64


@dataclass(frozen=True, eq=False)
class LayerTable:
    """Rows of owners by entry (block * L + band), for neurons and for edges.

    Attributes:
        beyond_m: (L,) ascending: band k is what is within the safety distance and ``beyond_m[k]``, and in no lower band.
        cells_shape: (3,) int64, the grid of cells.
        block_cells: cells along the edge of a block.
        node_offset, node_owner: as in :class:`~services.planner.core.lookup.LookupTable`, by entry instead of cell.
        edge_offset, edge_owner: the same for edges, and only where an edge is in a lower band than both of its ends.
    """

    beyond_m: F64
    cells_shape: I64
    block_cells: int
    node_offset: I64
    node_owner: U16
    edge_offset: I64
    edge_owner: U16

    @property
    def n_bands(self) -> int:
        """Number of layers."""
        return len(self.beyond_m)

    @property
    def n_blocks(self) -> int:
        """Number of blocks."""
        return int(np.prod(-(-self.cells_shape // self.block_cells)))

    def arrays(self) -> Mapping[str, NDArray[Any]]:
        """The rows by name, as a file has them."""
        return flat_rows(self.node_offset, self.node_owner, self.edge_offset, self.edge_owner)

    @property
    def n_bytes(self) -> int:
        """Bytes of the rows."""
        return sum(a.nbytes for a in (self.node_offset, self.node_owner, self.edge_offset, self.edge_owner))

    def neurons_of(self, block: int, band: int) -> I32:
        """Neurons in that band of a block, ascending."""
        return owners_in(self.node_offset, self.node_owner, block * self.n_bands + band)

    def edges_of(self, block: int, band: int) -> I32:
        """Edges in that band of a block, both ends in higher ones; ascending."""
        return owners_in(self.edge_offset, self.edge_owner, block * self.n_bands + band)


_NO_ROWS, _NOBODY = np.zeros((1, 1), dtype=np.int64), np.empty(0, dtype=np.uint16)
NO_LAYERS = LayerTable(np.empty(0), np.zeros(3, dtype=np.int64), 1, _NO_ROWS, _NOBODY, _NO_ROWS, _NOBODY)


class Near(NamedTuple):
    """What the searches are told of clearance."""

    node: U64  # (N,) occupied blocks by band of a neuron, as in NearCounts
    edge: U64  # (M,) of an edge, those that are nearer to it than to its ends
    n_bits: int  # of a band's share in a count
    factor: F64  # (L,) by band, how many times an edge in it costs its length; empty: all cost their length


def most_blocks(n_bands: int) -> int:
    """How many blocks can be counted where ``n_bands`` share a word."""
    return int((1 << WORD_BITS // max(1, n_bands)) - 1)


class NearCounts:
    """How many occupied blocks lie in each band of each neuron and edge: the layers' view of one world.

    The counts of all bands share one word, the lowest band in the lowest ``n_bits``: so a search sees with one look whether anything is
    near, and what is nearest to any of three things in the OR of their counts.

    Attributes:
        node, edge: (N,), (M,) uint64. n_bits: of a band's share.

    Args:
        table: the layers. n_neurons, n_edges: of the map.

    Raises:
        ValueError: more blocks than can be counted.
    """

    def __init__(self, table: LayerTable, n_neurons: int, n_edges: int) -> None:
        self._table = table
        self.n_bits = WORD_BITS // max(1, table.n_bands)
        if table.n_blocks > most_blocks(table.n_bands):
            raise ValueError(f"{table.n_blocks} blocks in {table.n_bands} layers: at most {most_blocks(table.n_bands)} can be counted")
        self.node = np.zeros(n_neurons, dtype=np.uint64)
        self.edge = np.zeros(n_edges, dtype=np.uint64)
        self._block_count = np.zeros(table.n_blocks, dtype=np.int32)

    def change(self, appeared: I32, gone: I32) -> None:
        """Cells that appeared and cells that are gone, each (n,) int32."""
        t = self._table
        if t.n_bands == 0:
            return
        for cells, sign in ((appeared, 1), (gone, -1)):
            if len(cells) == 0:  # mostly so of one of the two, and a call costs more than to see that
                continue
            change_layers(
                cells, sign, t.cells_shape, t.block_cells, self._block_count, t.n_bands, self.n_bits,
                t.node_offset, t.node_owner, self.node, t.edge_offset, t.edge_owner, self.edge,
            )  # fmt: skip

    def copy(self) -> NearCounts:
        """The same counts, to be changed independently."""
        twin = NearCounts(self._table, 0, 0)
        twin.node, twin.edge, twin._block_count = self.node.copy(), self.edge.copy(), self._block_count.copy()
        return twin
