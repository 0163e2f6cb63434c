"""Growing a lookup table by rows of new owners, and joining the rows of two. Twins: ``tests/support/slow_merging.py``."""

from __future__ import annotations

from numba import njit

__all__ = ["append_owners", "copy_rows", "count_unions", "fill_unions"]


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


@njit(cache=True, nogil=True)
def count_unions(offset_a, owner_a, offset_b, owner_b, counts):  # type: ignore[no-untyped-def]
    """How many owners are in row c of either table, into ``counts`` (n_cells,); owners ascend within a row."""
    for cell in range(len(counts)):
        i, k, n = offset_a[cell], offset_b[cell], 0
        end_a, end_b = offset_a[cell + 1], offset_b[cell + 1]
        while i < end_a and k < end_b:
            first, second = owner_a[i], owner_b[k]
            if first <= second:
                i += 1
            if second <= first:
                k += 1
            n += 1
        counts[cell] = n + (end_a - i) + (end_b - k)


@njit(cache=True, nogil=True)
def fill_unions(offset_a, owner_a, offset_b, owner_b, offset, owner):  # type: ignore[no-untyped-def]
    """The owners that :func:`count_unions` counts, ascending, into ``owner`` by ``offset`` (n_cells + 1,).

    Rows that are empty there stay so.
    """
    for cell in range(len(offset) - 1):
        at = offset[cell]
        if at == offset[cell + 1]:
            continue
        i, k = offset_a[cell], offset_b[cell]
        end_a, end_b = offset_a[cell + 1], offset_b[cell + 1]
        while i < end_a or k < end_b:
            take_a = k == end_b or (i < end_a and owner_a[i] <= owner_b[k])
            take_b = i == end_a or (k < end_b and owner_b[k] <= owner_a[i])
            owner[at] = owner_a[i] if take_a else owner_b[k]
            i, k, at = i + take_a, k + take_b, at + 1
