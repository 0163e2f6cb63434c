"""The layers of a lookup table: block of cells -> neurons and edges near it, by bands of distance.

Layers are of blocks and not of cells, since a volume grows with its width: in cells of 2 cm the layers up to 10 cm beyond the safety
distance would have about eight times as many entries as in blocks of 4 cm, in which they are as large as the table itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from services.planner.core.rows import flat_rows, owners_in
from services.planner.kernels.lookup import PAGE
from services.planner.kernels.near import WORD_BITS, fill_sets

__all__ = ["NO_LAYERS", "LayerTable", "Sets"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]
U16 = NDArray[np.uint16]
U64 = NDArray[np.uint64]
# A row is a set of bits where it holds one owner in so many or more: the set takes at most twice the bytes of the list.
OWNERS_OF_A_SET = 32


class Sets(NamedTuple):
    """The rows that are sets of bits; fields as in :class:`services.planner.kernels.near.Rows`."""

    number: I32
    words: U64


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

    @cached_property
    def node_sets(self) -> Sets:
        """The longest rows of neurons as sets."""
        return _sets_of(self.node_offset, self.node_owner)

    @cached_property
    def edge_sets(self) -> Sets:
        """The longest rows of edges as sets; there may well be none."""
        return _sets_of(self.edge_offset, self.edge_owner)

    def neurons_of(self, block: int, band: int) -> I32:
        """Neurons in that band of a block, ascending."""
        return owners_in(self.node_offset, self.node_owner, block * self.n_bands + band)

    def edges_of(self, block: int, band: int) -> I32:
        """Edges in that band of a block, both ends in higher ones; ascending."""
        return owners_in(self.edge_offset, self.edge_owner, block * self.n_bands + band)


def _sets_of(offset: I64, owner: U16) -> Sets:
    n_owners = PAGE if len(offset) > 1 else int(owner.max(initial=0)) + 1
    is_set = np.diff(offset, axis=1) * OWNERS_OF_A_SET >= n_owners
    number = np.where(is_set, np.cumsum(is_set).reshape(is_set.shape) - 1, -1).astype(np.int32)
    words = np.zeros((int(is_set.sum()), -(-n_owners // WORD_BITS)), dtype=np.uint64)
    fill_sets(offset, owner, number, words)
    return Sets(number, words)


_NO_ROWS, _NOBODY = np.zeros((1, 1), dtype=np.int64), np.empty(0, dtype=np.uint16)
NO_LAYERS = LayerTable(np.empty(0), np.zeros(3, dtype=np.int64), 1, _NO_ROWS, _NOBODY, _NO_ROWS, _NOBODY)
