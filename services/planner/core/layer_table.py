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

__all__ = ["NO_LAYERS", "LayerTable", "Near", "NearCounts"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]
U16 = NDArray[np.uint16]


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
    """What the searches are told of clearance; with no surcharge it costs nothing."""

    node: I32  # (N, L) occupied blocks in each band of a neuron
    edge: I32  # (M, L) the same of an edge beyond its ends
    surcharge: F64  # (L,) share by which an edge in that band costs more


class NearCounts:
    """How many occupied blocks lie in each band of each neuron and edge: the layers' view of one world.

    Args:
        table: the layers. n_neurons, n_edges: of the map.
    """

    def __init__(self, table: LayerTable, n_neurons: int, n_edges: int) -> None:
        self._table = table
        self.node = np.zeros((n_neurons, table.n_bands), dtype=np.int32)
        self.edge = np.zeros((n_edges, table.n_bands), dtype=np.int32)
        self._block_count = np.zeros(table.n_blocks, dtype=np.int32)

    def change(self, appeared: I32, gone: I32) -> None:
        """Cells that appeared and cells that are gone, each (n,) int32."""
        t = self._table
        if t.n_bands == 0:
            return
        for cells, sign in ((appeared, 1), (gone, -1)):
            change_layers(
                cells, sign, t.cells_shape, t.block_cells, self._block_count,
                t.node_offset, t.node_owner, self.node, t.edge_offset, t.edge_owner, self.edge,
            )  # fmt: skip

    def copy(self) -> NearCounts:
        """The same counts, to be changed independently."""
        twin = NearCounts(self._table, 0, 0)
        twin.node, twin.edge, twin._block_count = self.node.copy(), self.edge.copy(), self._block_count.copy()
        return twin

    def node_band(self) -> I64:
        """(N,) the lowest band in which something is, ``n_bands`` where nothing is near."""
        return _lowest(self.node)

    def edge_band(self, edges: I32) -> I64:
        """(M,) the same for ``edges`` (M, 2), their ends included."""
        node = self.node_band()
        return np.asarray(np.minimum(_lowest(self.edge), node[edges].min(axis=1)))


def _lowest(count: I32) -> I64:
    """(K,) the first column of ``count`` (K, L) that is above zero, L if none is."""
    lowest = np.full(len(count), count.shape[1], dtype=np.int64)
    for k in reversed(range(count.shape[1])):
        lowest[count[:, k] > 0] = k
    return lowest
