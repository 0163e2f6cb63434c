"""Rows of owners by cell, in pages: however many owners there are, 16 bits tell which one.

A row holds owners in ascending order. Numbers beyond 65 535 would need 32 bits and a table twice as large; so page p is a table of its own
for the owners from ``p * PAGE`` on, which it numbers from 0. Up to ``PAGE`` owners there is one page, and all is as if there were none.

Everywhere: ``offset`` (P, n_rows + 1) int64 and ``owner`` (E,) uint16; page p has ``owner[offset[p, r]:offset[p, r + 1]]`` in row r.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from services.planner.kernels.lookup import PAGE, count_rows
from services.planner.kernels.merging import append_owners, copy_rows

__all__ = ["flat_rows", "merged", "n_pages", "owners_in", "rows_of_flat", "transposed"]

I32 = NDArray[np.int32]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]
U16 = NDArray[np.uint16]


def n_pages(n_owners: int) -> int:
    """Pages of ``n_owners``; one of none."""
    return max(1, -(-n_owners // PAGE))


def flat_rows(node_offset: I64, node_owner: U16, edge_offset: I64, edge_owner: U16) -> Mapping[str, NDArray[Any]]:
    """Rows of neurons and edges by name, as a file has them: offsets of one page after the other."""
    return {"node_offset": node_offset.ravel(), "node_owner": node_owner, "edge_offset": edge_offset.ravel(), "edge_owner": edge_owner}


def rows_of_flat(arrays: Mapping[str, NDArray[Any]], n_rows: int) -> tuple[I64, U16, I64, U16]:
    """What :func:`flat_rows` was given; ``n_rows``: rows of a page.

    Raises:
        KeyError: an array is missing.
        ValueError: arrays of other rows, or of 32 bits as before there were pages.
    """
    node_offset, edge_offset = (np.asarray(arrays[f"{what}_offset"].reshape(-1, n_rows + 1)) for what in ("node", "edge"))
    for name in ("node_owner", "edge_owner"):
        if arrays[name].dtype != np.uint16:
            raise ValueError(f"{name} has {arrays[name].dtype}, rows are of uint16")
    return node_offset, arrays["node_owner"], edge_offset, arrays["edge_owner"]


def owners_in(offset: I64, owner: U16, row: int) -> I32:
    """(n,) the owners of a row, ascending."""
    pages = [owner[first:last].astype(np.int32) + page * PAGE for page, (first, last) in enumerate(offset[:, row : row + 2])]
    return np.concatenate(pages)


def transposed(offset: I64, cells: I32, n_rows: int, without: I32) -> tuple[I64, U16]:
    """Rows of owners by cell from rows of cells by owner.

    Args:
        offset, cells: cells of owner k are ``cells[offset[k]:offset[k + 1]]``; (n + 1,) int64.
        n_rows: number of cells.
        without: (U,) cells whose rows are left empty.
    """
    left_out = np.zeros(n_rows, dtype=np.uint8)
    left_out[without] = 1
    nothing = np.zeros((1, n_rows + 1), dtype=np.int64), np.empty(0, dtype=np.uint16)
    return merged(nothing, 0, (offset, cells), np.zeros(n_rows, dtype=np.uint8), left_out)


def merged(old: tuple[I64, U16], n_old: int, new: tuple[I64, I32], is_full: U8, is_left_out: U8) -> tuple[I64, U16]:
    """The rows ``old`` of ``n_old`` owners with further owners behind them.

    Args:
        old: offset and owner.
        n_old: number of old owners.
        new: cells of new owner k are ``cells[offset[k]:offset[k + 1]]``; the new owners get the numbers from ``n_old`` on.
        is_full: (n_rows,) where set, the row holds every old owner, whatever it was.
        is_left_out: (n_rows,) where set, no new owner joins the row.
    """
    (old_offset, old_owner), (offset, cells) = old, new
    n_new = len(offset) - 1
    row_offset = np.zeros((n_pages(n_old + n_new), len(is_full) + 1), dtype=np.int64)
    old_rows = np.zeros_like(row_offset)
    old_rows[: len(old_offset)] = old_offset
    shares = [_shares(n_old, n_new, page) for page in range(len(row_offset))]
    n_entries = 0
    for page, (n_here, newcomers) in enumerate(shares):
        more = np.zeros(len(is_full), dtype=np.int64)
        count_rows(cells[offset[newcomers.start] : offset[newcomers.stop]], more)
        more[is_left_out > 0] = 0
        counts = np.where(is_full > 0, n_here, np.diff(old_rows[page])) + more
        row_offset[page] = n_entries + np.concatenate([[0], np.cumsum(counts)])
        n_entries = row_offset[page, -1]
    owner, cursor = np.empty(n_entries, dtype=np.uint16), np.empty(len(is_full), dtype=np.int64)
    for page, (n_here, newcomers) in enumerate(shares):
        copy_rows(old_rows[page], old_owner, is_full, n_here, row_offset[page], owner, cursor)
        first_owner = n_old + newcomers.start - page * PAGE
        append_owners(offset[newcomers.start : newcomers.stop + 1], cells, is_left_out, first_owner, cursor, owner)
    return row_offset, owner


def _shares(n_old: int, n_new: int, page: int) -> tuple[int, range]:
    """How many old owners are in a page, and which of the new ones."""
    first, last = page * PAGE, (page + 1) * PAGE
    newcomers = range(min(max(first - n_old, 0), n_new), min(max(last - n_old, 0), n_new))
    return min(max(n_old - first, 0), PAGE), newcomers
