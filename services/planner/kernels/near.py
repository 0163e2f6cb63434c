"""What is near now: occupied blocks by band of neurons and edges, and the lowest band of each in which something is.

Most of what a changed world costs are the longest rows of the layers: blocks in the middle of the workspace, each near a third of all
neurons. Such a row is a set of bits: of the blocks that are occupied those are put together word by word. Shorter rows are lists, counted
owner by owner. Twin: ``tests/support/slow_layers.py``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from common.kernel import kernel, leaf
from services.planner.kernels.lookup import PAGE
from services.planner.kernels.prefetch import AHEAD, fetch_row, prefetch

__all__ = ["WORD_BITS", "Blocks", "Rows", "change_near", "fill_sets"]

I32 = NDArray[np.int32]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]
U16 = NDArray[np.uint16]
U64 = NDArray[np.uint64]

WORD_BITS = 64
WORDS_A_LINE = 8


class Blocks(NamedTuple):
    """Blocks of cells, and which of them are occupied."""

    cells_shape: I64  # (3,) of the grid of cells
    block_cells: int  # cells along an edge of a block
    n_cells: I32  # (n_blocks,) occupied cells in each
    occupied: I32  # (n_blocks,) the occupied ones, in any order, in its first ``n`` places
    place: I32  # (n_blocks,) where an occupied block is in ``occupied``
    n: I64  # (1,)


class Rows(NamedTuple):
    """Rows of owners by entry (block * L + band), in pages (:mod:`services.planner.core.rows`), and what is known of the owners now."""

    offset: I64  # (P, n_blocks * L + 1)
    owner: U16
    number: I32  # (P, n_blocks * L) which of ``words`` a row is; -1: it is a list
    words: U64  # (n_sets, W) owner w * 64 + j of the row's page is bit j of word w
    joined: U64  # (L, P * W) owners near which, by a row that is a set, any block is occupied
    n_blocks: I32  # (L, n_owners) occupied blocks in each band, of those whose row is a list
    nearest: U8  # (n_owners,) lowest band in which something is; L: nothing is near
    clear: U8  # (n_owners or P * W * 64, whichever is more) scratch


@kernel
def change_near(appeared, gone, blocks, nodes, edges):  # type: ignore[no-untyped-def]
    """Take in that cells appeared and that others are gone, each (n,)."""
    more, less = np.empty(len(appeared), dtype=np.int64), np.empty(len(gone), dtype=np.int64)
    n_more, n_less = _turned(appeared, 1, blocks, more), _turned(gone, -1, blocks, less)
    if n_more + n_less == 0:
        return
    for rows in (nodes, edges):
        _add(more[:n_more], 1, rows)
        _add(less[:n_less], -1, rows)
        if n_less > 0:
            rows.joined[:] = np.uint64(0)
            _join(blocks.occupied[: blocks.n[0]], rows)
        else:
            _join(more[:n_more], rows)
        _tell_nearest(rows)


@leaf
def _turned(cells, sign, blocks, turned):  # type: ignore[no-untyped-def]
    """Count ``cells`` in (``sign`` 1) or out (-1); fills ``turned`` with the blocks that become occupied or empty, returns how many."""
    shape, edge, n = blocks.cells_shape, blocks.block_cells, 0
    blocks_y, blocks_z = -(-shape[1] // edge), -(-shape[2] // edge)
    for cell in cells:
        x, y, z = cell // (shape[1] * shape[2]), (cell // shape[2]) % shape[1], cell % shape[2]
        block = ((x // edge) * blocks_y + y // edge) * blocks_z + z // edge
        before = blocks.n_cells[block]
        blocks.n_cells[block] = before + sign
        if before == 0:
            blocks.occupied[blocks.n[0]], blocks.place[block] = block, blocks.n[0]
            blocks.n[0] += 1
        elif before + sign == 0:
            blocks.n[0] -= 1
            last = blocks.occupied[blocks.n[0]]
            blocks.occupied[blocks.place[block]], blocks.place[last] = last, blocks.place[block]
        else:
            continue
        turned[n] = block
        n += 1
    return n


@leaf
def _add(blocks, sign, rows):  # type: ignore[no-untyped-def]
    """Add ``sign`` to the counts of all owners in the lists of ``blocks``."""
    n, n_bands = len(blocks), len(rows.n_blocks)
    for page in range(len(rows.offset)):
        offset, number = rows.offset[page], rows.number[page]
        for b in range(n):
            if b + 2 * AHEAD < n:
                prefetch(offset, np.int64(blocks[b + 2 * AHEAD] * n_bands))
                prefetch(number, np.int64(blocks[b + 2 * AHEAD] * n_bands))
            for k in range(n_bands):
                if b + AHEAD < n and number[blocks[b + AHEAD] * n_bands + k] < 0:
                    fetch_row(offset, rows.owner, blocks[b + AHEAD] * n_bands + k, blocks[b + AHEAD] * n_bands + k + 1)
                row, mine = blocks[b] * n_bands + k, rows.n_blocks[k, page * PAGE :]
                if number[row] < 0:
                    for owner in rows.owner[offset[row] : offset[row + 1]]:
                        mine[np.uint64(owner)] += sign


@leaf
def _join(blocks, rows):  # type: ignore[no-untyped-def]
    """Put the sets of ``blocks`` to ``rows.joined``."""
    n, n_bands, n_words = len(blocks), len(rows.n_blocks), rows.words.shape[1]
    for page in range(len(rows.number)):
        number = rows.number[page]
        for b in range(n):
            for k in range(n_bands):
                if b + AHEAD < n and number[blocks[b + AHEAD] * n_bands + k] >= 0:
                    ahead = np.int64(number[blocks[b + AHEAD] * n_bands + k]) * n_words
                    for w in range(0, n_words, WORDS_A_LINE):
                        prefetch(rows.words, ahead + w)
                row = number[blocks[b] * n_bands + k]
                if row >= 0:
                    words, joined = rows.words[row], rows.joined[k, page * n_words : (page + 1) * n_words]
                    for w in range(n_words):
                        joined[w] |= words[w]


@leaf
def _tell_nearest(rows):  # type: ignore[no-untyped-def]
    """Fill ``rows.nearest`` from counts and joined sets: the number of bands below the first in which something is.

    Sums of bytes without a branch, and words of a fixed length, are what the compiler takes many owners at a time in. Measured at 23 445
    edges: 25 us, and 237 us with a choice for each owner.
    """
    n, nearest, clear, joined = len(rows.nearest), rows.nearest, rows.clear, rows.joined
    for i in range(len(clear)):
        clear[i] = np.uint8(1)
    for i in range(n):
        nearest[i] = np.uint8(0)
    for k in range(len(rows.n_blocks)):
        n_blocks = rows.n_blocks[k]
        for i in range(n):
            clear[i] &= np.uint8(n_blocks[i] == 0)
        for w in range(joined.shape[1]):
            word = joined[k, w]
            if word != 0:
                here = clear[w * WORD_BITS : (w + 1) * WORD_BITS]
                for j in range(WORD_BITS):
                    here[j] &= np.uint8(~(word >> np.uint64(j)) & np.uint64(1))
        for i in range(n):
            nearest[i] += clear[i]


@leaf
def fill_sets(offset, owner, number, words):  # type: ignore[no-untyped-def]
    """Set the bits of ``words`` (n_sets, W), zero before, of the rows that have a ``number``; arguments as in :class:`Rows`."""
    for page in range(len(number)):
        for row in range(number.shape[1]):
            if number[page, row] >= 0:
                mine = words[number[page, row]]
                for one in owner[offset[page, row] : offset[page, row + 1]]:
                    mine[one // WORD_BITS] |= np.uint64(1) << np.uint64(one % WORD_BITS)
