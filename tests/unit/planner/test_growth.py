"""A grown table is the table that would have been built from nothing."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.geometry.grid import Grid
from services.planner.core.cognitive_map import CognitiveMap
from services.planner.core.growth import Addition, Ground, grown
from services.planner.core.lookup import build_table
from services.planner.core.roadmap import Roadmap
from services.planner.kernels.merging import append_owners, copy_rows
from tests.support.slow_merging import slow_merge

GRID = Grid((-0.8, -0.8, 0.0), (40, 40, 25), 0.04)
ARRAYS = ("node_offset", "node_owner", "edge_offset", "edge_owner", "unavoidable")


@pytest.fixture(scope="module")
def small(bench):
    """Ten neurons in a ring, some far from the others."""
    q = bench.free_rad[:10]
    edges = np.array([[k, k + 1] for k in range(9)] + [[0, 9]], dtype=np.int32)
    ground = Ground(bench.checker.arm, GRID, 0.02, 0.02)
    return SimpleNamespace(q=q, edges=edges, ground=ground, roadmap=roadmap(q, edges, ground))


def roadmap(q, edges, ground):
    table = build_table(ground.arm, ground.grid, q, edges, safety_m=ground.safety_m, step_m=ground.step_m)
    return Roadmap.of(CognitiveMap(q, edges), table, "gng")


def assert_equal(one: Roadmap, other: Roadmap) -> None:
    for name in ARRAYS:
        a, b = getattr(one.table, name), getattr(other.table, name)
        assert a.dtype == b.dtype and np.array_equal(a, b), name
    for name in ("neurons_rad", "edges", "adj_offset", "adj_node", "adj_edge", "adj_length"):
        a, b = getattr(one, name), getattr(other, name)
        assert a.dtype == b.dtype and np.array_equal(a, b), name


@pytest.mark.parametrize("case", ["neurons and edges", "only edges", "only neurons", "in two steps"])
def test_a_grown_map_equals_one_built_from_nothing(bench, small, case):
    q_new = bench.free_rad[20:23]
    edges_new = np.array([[3, 10], [10, 11], [11, 12], [2, 12], [4, 7]], dtype=np.int32)
    if case == "only edges":
        q_new, edges_new = q_new[:0], edges_new[-1:]
    elif case == "only neurons":
        edges_new = edges_new[:0]
    if case == "in two steps":
        first = grown(small.roadmap, Addition(q_new[:1], edges_new[:1]), small.ground)
        result = grown(first, Addition(q_new[1:], edges_new[1:]), small.ground)
    else:
        result = grown(small.roadmap, Addition(q_new, edges_new), small.ground)
    assert_equal(result, roadmap(np.vstack([small.q, q_new]), np.vstack([small.edges, edges_new]), small.ground))
    assert (result.n_built, result.n_built_edges) == (10, 10) and result.has_learned and not small.roadmap.has_learned


def test_a_cell_that_a_new_neuron_spares_can_be_avoided_from_then_on(bench):
    """Neurons around one pose sweep much in common; a far one does not."""
    ground = Ground(bench.checker.arm, GRID, 0.02, 0.02)
    q = bench.free_rad[0] + np.linspace(0.0, 0.2, 5)[:, None]
    edges = np.array([[k, k + 1] for k in range(4)], dtype=np.int32)
    before = roadmap(q, edges, ground)
    far = bench.free_rad[np.argmax(np.linalg.norm(bench.free_rad - q[0], axis=1))]
    addition = Addition(far[None], np.array([[0, 5], [4, 5]], dtype=np.int32))
    after = grown(before, addition, ground)
    spared = np.setdiff1d(before.table.unavoidable, after.table.unavoidable)
    assert len(spared) > 50
    assert after.table.neurons_of(int(spared[0])).tolist() == [0, 1, 2, 3, 4]
    assert_equal(after, roadmap(np.vstack([q, far]), np.vstack([edges, addition.edges]), ground))


def test_owners_beyond_16_bits_are_on_another_page(small):
    """65 536 owners are on one page, one more is on a second; the rows stay what they were."""
    n = 1 << 16
    q = np.repeat(small.q[:1], n, axis=0)
    table = small.roadmap.table
    none = np.empty((0, 2), dtype=np.int32)
    many = Roadmap.of(CognitiveMap(q, none), table, "gng")
    assert len(table.node_offset) == 1
    wide = grown(many, Addition(small.q[3:4], none), small.ground).table
    assert wide.node_owner.dtype == np.uint16 and len(wide.node_offset) == 2
    cell = int(np.setdiff1d(np.flatnonzero(np.diff(wide.node_offset[1])), table.unavoidable)[0])
    assert wide.neurons_of(cell).tolist() == [*table.neurons_of(cell).tolist(), n]


def test_nothing_added_is_the_same_map(small):
    nothing = Addition(np.empty((0, 6)), np.empty((0, 2), dtype=np.int32))
    assert nothing.is_empty and grown(small.roadmap, nothing, small.ground) is small.roadmap


def test_the_old_map_is_left_as_it_is(bench, small):
    before = {name: getattr(small.roadmap.table, name).copy() for name in ARRAYS}
    grown(small.roadmap, Addition(bench.free_rad[30:31], np.array([[0, 10]], dtype=np.int32)), small.ground)
    for name, array in before.items():
        assert np.array_equal(getattr(small.roadmap.table, name), array)


CELLS = 6
ROWS = st.lists(st.sets(st.integers(0, 4)).map(sorted), min_size=CELLS, max_size=CELLS)


@settings(max_examples=60, deadline=None)
@given(ROWS, st.lists(st.sets(st.integers(0, CELLS - 1)).map(sorted), max_size=4), st.sets(st.integers(0, CELLS - 1)), st.booleans())
def test_kernels_do_what_their_twin_does(old, new, special, special_is_full):
    full, left_out = (special, set()) if special_is_full else (set(), special)
    old = [[] if cell in special else row for cell, row in enumerate(old)]
    expected = slow_merge(old, new, 5, full=full, left_out=left_out)
    old_offset = np.concatenate([[0], np.cumsum([len(row) for row in old])]).astype(np.int64)
    old_owner = np.array([k for row in old for k in row], dtype=np.uint16)
    row_offset = np.concatenate([[0], np.cumsum([len(row) for row in expected])]).astype(np.int64)
    owner, cursor = np.empty(row_offset[-1], dtype=np.uint16), np.empty(CELLS, dtype=np.int64)
    offset = np.concatenate([[0], np.cumsum([len(row) for row in new])]).astype(np.int64)
    cells = np.array([c for row in new for c in row], dtype=np.int32)
    is_full, is_left_out = (np.array([c in which for c in range(CELLS)], dtype=np.uint8) for which in (full, left_out))
    copy_rows(old_offset, old_owner, is_full, 5, row_offset, owner, cursor)
    append_owners(offset, cells, is_left_out, 5, cursor, owner)
    assert [owner[a:b].tolist() for a, b in pairwise(row_offset)] == expected
    assert cursor.tolist() == row_offset[1:].tolist()
