"""Growing a lookup table by rows of new owners, and joining the rows of two. Twins: ``tests/support/slow_merging.py``."""

from __future__ import annotations

from common.kernel import leaf

__all__ = ["append_owners", "copy_rows", "count_unions", "fill_unions"]


@leaf
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


@leaf
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


@leaf
def count_unions(offset_a, owner_a, offset_b, owner_b, n_bands, seen, counts):  # type: ignore[no-untyped-def]
    """How many owners row r of the union of two tables has, into ``counts`` (n_rows,); owners ascend within a row.

    Args:
        offset_a, owner_a, offset_b, owner_b: the two tables.
        n_bands: so many rows in succession are bands of one thing; an owner is in the lowest band alone in which either table has it.
        seen: (n_owners,) int64, -1: scratch.
    """
    for row in range(len(counts)):
        i, k, n = offset_a[row], offset_b[row], 0
        end_a, end_b = offset_a[row + 1], offset_b[row + 1]
        while i < end_a or k < end_b:
            owner, i, k = _next(owner_a, owner_b, i, end_a, k, end_b)
            if seen[owner] != row // n_bands:
                seen[owner] = row // n_bands
                n += 1
        counts[row] = n


@leaf
def fill_unions(offset_a, owner_a, offset_b, owner_b, n_bands, seen, offset, owner):  # type: ignore[no-untyped-def]
    """The owners that :func:`count_unions` counts, ascending, into ``owner`` by ``offset`` (n_rows + 1,).

    Rows that are empty there stay so. Other arguments as for :func:`count_unions`.
    """
    for row in range(len(offset) - 1):
        at = offset[row]
        if at == offset[row + 1]:
            continue
        i, k = offset_a[row], offset_b[row]
        end_a, end_b = offset_a[row + 1], offset_b[row + 1]
        while i < end_a or k < end_b:
            one, i, k = _next(owner_a, owner_b, i, end_a, k, end_b)
            if seen[one] != row // n_bands:
                seen[one] = row // n_bands
                owner[at] = one
                at += 1


@leaf
def _next(owner_a, owner_b, i, end_a, k, end_b):  # type: ignore[no-untyped-def]
    """The lower one of two rows' next owners, and where both go on."""
    if k == end_b:
        return owner_a[i], i + 1, k
    if i == end_a or owner_b[k] < owner_a[i]:
        return owner_b[k], i, k + 1
    return owner_a[i], i + 1, k + (owner_a[i] == owner_b[k])
