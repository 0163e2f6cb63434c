from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.geometry.grid import Grid
from services.planner.core.lookup import BlockedCounts, build_table, cells_of_pose
from services.planner.core.world import cells_of
from services.planner.kernels.lookup import exposed_cells
from services.planner.kernels.moves import segment_steps
from tests.support.slow_planner import slow_counts, slow_exposed, slow_pose_cells


@pytest.fixture(scope="module")
def small(bench):
    """Twelve neurons in a coarse grid, each joined to the next."""
    grid = Grid((-0.8, -0.8, 0.0), (40, 40, 25), 0.04)
    rng = np.random.default_rng(5)
    q = np.empty((12, 6))
    q[::2] = bench.free_rad[:6]
    q[1::2] = q[::2] + rng.normal(scale=0.1, size=(6, 6))
    edges = np.array([[k, k + 1] for k in range(0, 12, 2)], dtype=np.int32)
    table = build_table(bench.checker.arm, grid, q, edges, safety_m=0.02, step_m=0.02)
    return grid, q, edges, table


def _row(grid, q, bench, safety=0.02):
    centres = grid.centres(np.arange(grid.n_cells))
    frames = bench.robot.joint_poses(q[None])[0]
    return np.flatnonzero(slow_pose_cells(bench.checker.arm, frames, centres, grid.resolution_m / 2, safety))


def test_rows_equal_brute_force_over_every_cell(bench, small):
    grid, q, _, table = small
    for k in range(4):
        brute = set(_row(grid, q[k], bench).tolist()) - set(table.unavoidable.tolist())
        assert {c for c in range(grid.n_cells) if k in table.neurons_of(c)} == brute
        assert set(cells_of_pose(bench.checker.arm, grid, q[k], safety_m=0.02).tolist()) - set(table.unavoidable.tolist()) == brute


def test_an_edge_holds_what_it_sweeps_beyond_its_ends(bench, small):
    grid, q, edges, table = small
    R, T = np.empty((2, 7, 3, 3)), np.empty((2, 7, 3))
    some = 0
    for e in range(3):
        a, b = q[edges[e, 0]], q[edges[e, 1]]
        n = segment_steps(bench.checker.arm, a, b - a, 0.02, R, T)
        swept = set().union(*(set(_row(grid, a + (b - a) * s / n, bench).tolist()) for s in range(1, n)))
        extra = swept - set(_row(grid, a, bench).tolist()) - set(_row(grid, b, bench).tolist()) - set(table.unavoidable.tolist())
        assert {c for c in range(grid.n_cells) if e in table.edges_of(c)} == extra
        some += len(extra)
    assert some > 0


def test_unavoidable_cells_are_in_no_row(small):
    grid, _, _, table = small
    assert len(table.unavoidable) > 0
    assert all(len(table.neurons_of(c)) == 0 and len(table.edges_of(c)) == 0 for c in table.unavoidable)
    full = [c for c in range(grid.n_cells) if len(table.neurons_of(c)) == 12]
    assert full == []


@settings(max_examples=40, deadline=None)
@given(st.lists(st.sets(st.integers(0, 40 * 40 * 25 - 1), max_size=60), min_size=1, max_size=5))
def test_counts_follow_differences_and_equal_a_recount(small, frames):
    _grid, q, edges, table = small
    counts = BlockedCounts(table, len(q), len(edges))
    before: set[int] = set()
    for frame in frames:
        appeared, gone = counts.set_cells(np.array(sorted(frame), dtype=np.int32))
        assert appeared.tolist() == sorted(frame - before) and gone.tolist() == sorted(before - frame)
        before = frame
    rows = {c: table.neurons_of(c).tolist() for c in frames[-1]}
    assert np.array_equal(counts.node, slow_counts(rows, frames[-1], len(q)))
    edge_rows = {c: table.edges_of(c).tolist() for c in frames[-1]}
    assert np.array_equal(counts.edge, slow_counts(edge_rows, frames[-1], len(edges)))


@settings(max_examples=40, deadline=None)
@given(st.sets(st.integers(0, 40 * 40 * 25 - 1), max_size=60), st.sets(st.integers(0, 40 * 40 * 25 - 1), max_size=60))
def test_more_cells_never_free_a_neuron(small, some, more):
    _, q, edges, table = small
    counts = BlockedCounts(table, len(q), len(edges))
    counts.set_cells(np.array(sorted(some), dtype=np.int32))
    before = counts.node > 0
    counts.set_cells(np.array(sorted(some | more), dtype=np.int32))
    assert not np.any(before & (counts.node == 0))


def test_without_is_a_copy(small):
    _, q, edges, table = small
    counts = BlockedCounts(table, len(q), len(edges))
    cells = np.flatnonzero(np.diff(table.node_offset))[:50].astype(np.int32)
    counts.set_cells(cells)
    before = counts.node.copy()
    fewer = counts.without(cells[:20])
    fresh = BlockedCounts(table, len(q), len(edges))
    fresh.set_cells(cells[20:])
    assert np.array_equal(fewer.node, fresh.node) and np.array_equal(fewer.edge, fresh.edge)
    assert np.array_equal(counts.node, before)


SIDES = st.tuples(*(st.integers(1, 30) for _ in range(3)))
CORNERS = st.tuples(st.integers(-10, 39), st.integers(-10, 39), st.integers(-5, 24))


def _filled(grid, boxes):
    """Ascending cells of boxes of cells: (corner, sides)."""
    full = np.zeros(grid.shape, dtype=bool)
    for corner, sides in boxes:
        full[tuple(slice(max(0, c), max(0, c + n)) for c, n in zip(corner, sides, strict=True))] = True
    return np.flatnonzero(full).astype(np.int32)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.lists(st.tuples(CORNERS, SIDES), max_size=4), min_size=1, max_size=3))
def test_enclosed_cells_need_not_be_counted(small, worlds):
    """The same neurons and edges are blocked, also by what swallows the arm; and ways of being told of a world do not matter."""
    grid, q, edges, table = small
    outer, every = BlockedCounts(table, len(q), len(edges), grid.shape), BlockedCounts(table, len(q), len(edges))
    for boxes in worlds:
        cells = _filled(grid, boxes)
        for a, b in zip(outer.set_cells(cells), every.set_cells(cells), strict=True):
            assert np.array_equal(a, b)
        assert np.array_equal(outer.node > 0, every.node > 0)
        assert outer.node.sum() <= every.node.sum()
        blocked, slow = ((c.edge > 0) | (c.node[edges] > 0).any(axis=1) for c in (outer, every))
        assert np.array_equal(blocked, slow)
    fresh = BlockedCounts(table, len(q), len(edges), grid.shape)
    fresh.set_cells(outer.cells)
    assert np.array_equal(fresh.node, outer.node) and np.array_equal(fresh.edge, outer.edge)
    fewer = outer.without(outer.cells[::3])
    fresh.set_cells(fewer.cells)
    assert np.array_equal(fresh.node, fewer.node) and np.array_equal(fresh.edge, fewer.edge)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.lists(st.tuples(CORNERS, SIDES), max_size=4), min_size=1, max_size=3), st.sets(st.integers(0, 39_999), max_size=50))
def test_exposed_cells_equal_the_obvious(worlds, never):
    grid = Grid((0.0, 0.0, 0.0), (40, 40, 25), 0.04)
    shape, occupied = np.array(grid.shape), np.zeros(42 * 42 * 27, dtype=np.uint8)
    empty = np.array(sorted(never), dtype=np.int32)
    before = np.empty(0, dtype=np.int32)
    for boxes in worlds:
        cells = _filled(grid, boxes)
        out = np.empty_like(cells)
        n = exposed_cells(cells, np.setdiff1d(cells, before), np.setdiff1d(before, cells), empty, shape, occupied, out)
        assert np.array_equal(out[:n], slow_exposed(cells, grid.shape, never))
        before = cells


def test_the_table_says_what_the_check_says(bench, small):
    grid, q, _, table = small
    rng = np.random.default_rng(6)
    for c in rng.choice(np.flatnonzero(np.diff(table.node_offset)), 60, replace=False):
        cell = cells_of(grid, np.array([c], dtype=np.int32))
        blocked = [k for k in range(len(q)) if bench.checker.cells_hit(cell, q[k]).any()]
        assert table.neurons_of(c).tolist() == blocked
