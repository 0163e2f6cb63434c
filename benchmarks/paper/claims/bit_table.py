"""The bit-encoded table that the paper's outlook names (Wu 2005), as we read it: for each cell one bit a neuron.

Blocked is the bitwise or of the occupied cells' rows. Wu's text was not at hand; this is the plain form of the idea, with rows only for
cells that block anything. A bit cannot count: when a cell becomes free, all rows are read anew.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.planner.core.lookup import LookupTable

__all__ = ["BitTable"]

I32 = NDArray[np.int32]
U8 = NDArray[np.uint8]
WORD_BYTES = 8  # rows are padded to whole machine words
CHUNK = 1024  # rows packed at a time; bounds the memory that packing takes


@dataclass(frozen=True, eq=False)
class BitTable:
    """Rows of bits by cell.

    Attributes:
        row_of: (n_cells,) int32 row of each cell, 0 for cells that block nothing (that row is empty).
        words: (R, W) uint64 rows of bits, neuron n at bit n, the most significant bit of a byte first.
        n_neurons: bits that count.
    """

    row_of: I32
    words: NDArray[np.uint64]
    n_neurons: int

    @staticmethod
    def of(table: LookupTable, n_neurons: int) -> BitTable:
        """The same table of neurons as bits."""
        cells = np.flatnonzero(np.diff(table.node_offset).sum(axis=0))
        n_bytes = -(-n_neurons // (8 * WORD_BYTES)) * WORD_BYTES
        packed = np.zeros((len(cells) + 1, n_bytes), dtype=np.uint8)
        for first in range(0, len(cells), CHUNK):
            part = cells[first : first + CHUNK]
            dense = np.zeros((len(part), 8 * n_bytes), dtype=np.bool_)
            for k, cell in enumerate(part):
                dense[k, table.neurons_of(cell)] = True
            packed[1 + first : 1 + first + len(part)] = np.packbits(dense, axis=1)
        row_of = np.zeros(table.node_offset.shape[1] - 1, dtype=np.int32)
        row_of[cells] = np.arange(1, len(cells) + 1)
        return BitTable(row_of, packed.view(np.uint64), n_neurons)

    @property
    def n_bytes(self) -> int:
        """Bytes of both arrays."""
        return self.row_of.nbytes + self.words.nbytes

    def blocked_words(self, cells: I32) -> NDArray[np.uint64]:
        """(W,) which neurons the cells (C,) block, as bits."""
        return np.asarray(np.bitwise_or.reduce(self.words[self.row_of[cells]], axis=0))

    def blocked(self, cells: I32) -> NDArray[np.bool_]:
        """(N,) the same, a bool a neuron."""
        return np.unpackbits(self.blocked_words(cells).view(np.uint8), count=self.n_neurons).astype(np.bool_)
