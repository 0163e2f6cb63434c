"""Growing a lookup table by rows of new owners, without touching those that are there. Twin: ``tests/support/slow_merging.py``."""

from __future__ import annotations

from numba import njit

__all__ = ["append_owners", "copy_rows"]


@njit(cache=True, nogil=True)
def copy_rows(old_offset, old_owner, is_full, n_full, row_offset, owner, cursor):  # type: ignore[no-untyped-def]
    """Copy each row of the old table to its place in the new one and leave ``cursor`` behind it.

    Args:
        old_offset, old_owner: the old table, rows by cell.
        is_full: (n_cells,) uint8; where set, the row becomes ``0 .. n_full - 1`` instead: every old owner.
        n_full: number of old owners.
        row_offset: (n_cells + 1,) rows of the new table.
        owner: out, the new table; of ``old_owner``'s dtype.
        cursor: (n_cells,) out, where the next owner of each row goes.
    """
    for cell in range(len(row_offset) - 1):
        at = row_offset[cell]
        if is_full[cell]:
            for k in range(n_full):
                owner[at + k] = k
            at += n_full
        else:
            for i in range(old_offset[cell], old_offset[cell + 1]):
                owner[at] = old_owner[i]
                at += 1
        cursor[cell] = at


@njit(cache=True, nogil=True)
def append_owners(offset, cells, is_left_out, first_owner, cursor, owner):  # type: ignore[no-untyped-def]
    """Append new owners, ascending, to the rows of their cells.

    Args:
        offset, cells: cells of new owner k are ``cells[offset[k]:offset[k + 1]]``.
        is_left_out: (n_cells,) uint8; cells that have no row.
        first_owner: number of new owner 0.
        cursor: (n_cells,) where the next owner of each row goes; moved on.
        owner: the new table.
    """
    for k in range(len(offset) - 1):
        for i in range(offset[k], offset[k + 1]):
            cell = cells[i]
            if not is_left_out[cell]:
                owner[cursor[cell]] = first_owner + k
                cursor[cell] += 1
