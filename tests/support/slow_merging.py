"""Slow and obvious twins of the kernels that grow a table and join two."""

from __future__ import annotations

__all__ = ["slow_merge", "slow_union"]


def slow_merge(old: list[list[int]], new: list[list[int]], n_old: int, *, full: set[int], left_out: set[int]) -> list[list[int]]:
    """Rows by cell: the old one (every old owner where ``full``), then the new owners whose cells hold it, unless it has no row."""
    rows = [list(range(n_old)) if cell in full else list(row) for cell, row in enumerate(old)]
    for k, cells in enumerate(new):
        for cell in cells:
            if cell not in left_out:
                rows[cell].append(n_old + k)
    return rows


def slow_union(a: list[list[int]], b: list[list[int]], n_bands: int) -> list[list[int]]:
    """Rows of two tables as one; of ``n_bands`` rows in succession an owner is in the first alone that has it in either table."""
    rows = [{*row_a, *row_b} for row_a, row_b in zip(a, b, strict=True)]
    for first in range(0, len(rows), n_bands):
        lower: set[int] = set()
        for row in range(first, first + n_bands):
            rows[row] -= lower
            lower |= rows[row]
    return [sorted(row) for row in rows]
