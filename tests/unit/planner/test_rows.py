"""Rows in pages hold what plain lists of owners hold, on either side of a page's border."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.planner.core import layer_table
from services.planner.core.layer_table import LayerTable
from services.planner.core.lookup import BlockedCounts, LookupTable
from services.planner.core.rows import flat_rows, merged, n_pages, owners_in, rows_of_flat, transposed
from services.planner.kernels.lookup import PAGE
from tests.support.slow_merging import slow_merge
from tests.support.slow_planner import slow_counts

CELLS = 6
NONE = np.zeros(CELLS, dtype=np.uint8)
NO_CELLS = np.empty(0, dtype=np.int32)
BORDERS = [0, 1, PAGE - 1, PAGE, PAGE + 1, 2 * PAGE - 1, 2 * PAGE, 2 * PAGE + 5]
SWEPT = st.dictionaries(st.sampled_from(BORDERS), st.sets(st.integers(0, CELLS - 1), min_size=1), max_size=6)
SOME = st.sets(st.integers(0, CELLS - 1))


def by_owner(swept: dict[int, set[int]], n: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows of cells of ``n`` owners, of whom most sweep nothing."""
    lengths = np.zeros(n, dtype=np.int64)
    lengths[list(swept)] = [len(cells) for cells in swept.values()]
    cells = [c for owner in sorted(swept) for c in sorted(swept[owner])]
    return np.concatenate([[0], np.cumsum(lengths)]), np.array(cells, dtype=np.int32)


def by_cell(swept: dict[int, set[int]]) -> list[list[int]]:
    return [sorted(owner for owner in swept if cell in swept[owner]) for cell in range(CELLS)]


def lists(rows: tuple[np.ndarray, np.ndarray]) -> list[list[int]]:
    return [owners_in(*rows, cell).tolist() for cell in range(CELLS)]


def marks(cells: set[int]) -> np.ndarray:
    return np.array([cell in cells for cell in range(CELLS)], dtype=np.uint8)


def test_pages_begin_where_16_bits_end() -> None:
    assert [n_pages(n) for n in (0, 1, PAGE, PAGE + 1, 2 * PAGE, 2 * PAGE + 1)] == [1, 1, 1, 2, 2, 3]


@settings(max_examples=40, deadline=None)
@given(SWEPT, st.sampled_from([2 * PAGE + 6, 2 * PAGE + 7]), SOME)
def test_transposed_rows_are_the_owners_of_each_cell(swept, n, without) -> None:
    rows = transposed(*by_owner(swept, n), CELLS, np.array(sorted(without), dtype=np.int32))
    assert rows[0].shape == (3, CELLS + 1) and rows[1].dtype == np.uint16
    assert lists(rows) == [[] if cell in without else row for cell, row in enumerate(by_cell(swept))]


@settings(max_examples=40, deadline=None)
@given(SWEPT, st.sampled_from([1, 2, PAGE - 1, PAGE, PAGE + 3]), SOME, st.booleans())
def test_merged_rows_are_those_of_the_twin_and_of_a_table_made_at_once(swept, n_old, special, special_is_full) -> None:
    old = {owner: cells for owner, cells in swept.items() if owner < n_old}
    n_new = 2 * PAGE + 6 - n_old
    new = {owner - n_old: cells for owner, cells in swept.items() if owner >= n_old}
    full, left_out = (special, set()) if special_is_full else (set(), special)
    old_rows = transposed(*by_owner(old, n_old), CELLS, np.array(sorted(full), dtype=np.int32))
    rows = merged(old_rows, n_old, by_owner(new, n_new), marks(full), marks(left_out))
    assert lists(rows) == slow_merge(lists(old_rows), [sorted(new.get(k, ())) for k in range(n_new)], n_old, full=full, left_out=left_out)
    if not special:
        at_once = transposed(*by_owner(swept, n_old + n_new), CELLS, NO_CELLS)
        assert all(np.array_equal(a, b) for a, b in zip(rows, at_once, strict=True))


@pytest.mark.parametrize("owners_of_a_set", [32, PAGE])  # no row of the layers is a set of bits; all are
@settings(max_examples=30, deadline=None)
@given(neurons=SWEPT, edges=SWEPT, before=SOME, after=SOME)
def test_counts_of_many_owners_are_those_of_plain_lists(owners_of_a_set, neurons, edges, before, after) -> None:
    """Of the table and of its layers, the cells here being blocks of one cell and one band."""
    n, m = 2 * PAGE + 6, 2 * PAGE + 9
    rows = *transposed(*by_owner(neurons, n), CELLS, NO_CELLS), *transposed(*by_owner(edges, m), CELLS, NO_CELLS)
    layers = LayerTable(np.array([0.1]), np.array([CELLS, 1, 1]), 1, *rows)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(layer_table, "OWNERS_OF_A_SET", owners_of_a_set)
        counts = BlockedCounts(LookupTable(*rows, NO_CELLS, layers), n, m)
    assert len(layers.node_sets.words) == (int((np.diff(layers.node_offset, axis=1) > 0).sum()) if owners_of_a_set == PAGE else 0)
    for cells in (before, after):
        counts.set_cells(np.array(sorted(cells), dtype=np.int32))
    for swept, count, nearest in ((neurons, counts.node, counts.near.node), (edges, counts.edge, counts.near.edge)):
        expected = slow_counts(dict(enumerate(by_cell(swept))), after, len(count))
        assert np.array_equal(count, expected)
        assert np.array_equal(nearest, np.where(expected > 0, 0, 1))


def test_a_file_holds_the_same_rows() -> None:
    rows = transposed(*by_owner({0: {1}, PAGE: {1, 3}}, PAGE + 2), CELLS, NO_CELLS)
    flat = flat_rows(*rows, *rows)
    assert flat["node_offset"].shape == (2 * (CELLS + 1),)
    assert all(np.array_equal(a, b) for a, b in zip(rows_of_flat(flat, CELLS), rows * 2, strict=True))


def test_rows_of_32_bits_are_refused() -> None:
    rows = transposed(*by_owner({0: {1}}, 2), CELLS, NO_CELLS)
    flat = flat_rows(*rows, *rows)
    with pytest.raises(ValueError, match="edge_owner has uint32"):
        rows_of_flat({**flat, "edge_owner": flat["edge_owner"].astype(np.uint32)}, CELLS)
