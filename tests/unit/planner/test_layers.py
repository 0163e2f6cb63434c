"""Layers of clearance: rows against brute force and coal, counts against recounts."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import coal
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.cell import load
from common.errors import ConfigError
from common.geometry.grid import Grid
from common.robot.pairs import coal_mesh
from services.planner.config import PlannerConfig
from services.planner.core import layer_table
from services.planner.core.cognitive_map import CognitiveMap
from services.planner.core.find import PathFinder
from services.planner.core.growth import Addition, Ground, grown
from services.planner.core.layer_table import NO_LAYERS
from services.planner.core.layers import LayerRules, build_layers
from services.planner.core.lookup import BlockedCounts, LookupTable, build_table, cells_of_pose
from services.planner.core.near import NearCounts
from services.planner.core.roadmap import Roadmap
from services.planner.kernels.moves import segment_steps
from tests.support.slow_layers import slow_nearest, slow_pose_bands

GRID = Grid((-0.8, -0.8, 0.0), (41, 40, 25), 0.04)  # odd sides: the last blocks stick out
BEYOND_M = [0.02, 0.05, 0.10]
STEP_M = 0.04


@pytest.fixture(scope="module")
def small(bench):
    """Eight neurons in blocks of 8 cm, each joined to its neighbour, and one edge between strangers."""
    arm = bench.checker.arm
    rules = LayerRules.of(arm, GRID, BEYOND_M, 0.08, safety_m=0.02, step_m=STEP_M)
    q = np.empty((8, 6))
    q[::2] = bench.free_rad[:4]
    q[1::2] = q[::2] + np.random.default_rng(5).normal(scale=0.1, size=(4, 6))
    edges = np.array([[0, 1], [0, 2], [2, 3], [4, 5], [6, 7]], dtype=np.int32)
    return SimpleNamespace(arm=arm, rules=rules, q=q, edges=edges, layers=build_layers(rules, q, edges))


def _brute(bench, small, q, blocks=None):
    """Bands of a pose by the slow twin, of all blocks or some."""
    origin, shape, edge = small.rules.blocks
    ijk = np.stack(np.unravel_index(np.arange(np.prod(shape)) if blocks is None else blocks, shape), axis=-1)
    frames = bench.robot.joint_poses(q[None])[0]
    return slow_pose_bands(small.arm, small.rules.reach, frames, origin + (ijk + 0.5) * edge, edge / 2, small.rules.within_m)


def _bands(small, rows_of, owner):
    """(n_blocks,) the band of an owner by the table."""
    table = small.layers
    bands = np.full(table.n_blocks, table.n_bands)
    for block in range(table.n_blocks):
        for band in range(table.n_bands):
            if owner in rows_of(block, band):
                assert bands[block] == table.n_bands, "an owner is once in a block's rows"
                bands[block] = band
    return bands


def test_a_neurons_bands_equal_brute_force(bench, small):
    for k in (0, 3):
        brute = _brute(bench, small, small.q[k])
        assert np.array_equal(_bands(small, small.layers.neurons_of, k), brute)
        assert {0, 1, 2, 3} == set(brute)


def test_an_edge_is_where_it_comes_nearer_than_its_ends(bench, small):
    R, T = np.empty((2, 7, 3, 3)), np.empty((2, 7, 3))
    e = 1
    a, b = small.q[small.edges[e]]
    n = segment_steps(small.arm, a, b - a, STEP_M, R, T)
    some = np.linspace(0, 1, n + 1)[1:-1]
    blocks = np.random.default_rng(2).choice(small.layers.n_blocks, small.layers.n_blocks // 3, replace=False)
    way = np.min([_brute(bench, small, a + (b - a) * s, blocks) for s in some], axis=0)
    ends = np.minimum(_brute(bench, small, a, blocks), _brute(bench, small, b, blocks))
    expected = np.where(way < ends, way, small.layers.n_bands)
    assert np.array_equal(_bands(small, small.layers.edges_of, e)[blocks], expected)
    assert (expected < small.layers.n_bands).any()


def test_a_band_is_never_farther_than_the_truth_and_seldom_much_nearer(bench, small):
    """coal: exact distance between a block and the bare meshes."""
    meshes = [(coal_mesh(body), body.joint) for body in bench.robot.bodies if not body.immobile]
    origin, shape, edge = small.rules.blocks
    cube = coal.Box(edge, edge, edge)
    bands = _bands(small, small.layers.neurons_of, 0)
    frames = [coal.Transform3s(np.ascontiguousarray(T[:3, :3]), T[:3, 3].copy()) for T in bench.robot.joint_poses(small.q[:1])[0]]
    rounding = edge / 4 * np.sqrt(3) + 0.0087 + 0.0173 + 0.0025  # of the octants, the fine and the coarse grids, the covers' rest
    for block in np.random.default_rng(1).choice(len(bands), 300, replace=False):
        at = coal.Transform3s(np.eye(3), origin + (np.array(np.unravel_index(block, shape)) + 0.5) * edge)
        true = min(coal.distance(m, frames[j], cube, at, coal.DistanceRequest(), coal.DistanceResult()) for m, j in meshes)
        inner = 0.0 if bands[block] == 0 else small.rules.within_m[bands[block] - 1]
        outer = np.inf if bands[block] == 3 else small.rules.within_m[bands[block]]
        assert inner < max(true, 1e-9), "told farther than it is"
        assert true <= outer + rounding


def _table(small):
    n = GRID.n_cells + 1
    rows = (np.zeros((1, n), dtype=np.int64), np.empty(0, dtype=np.uint16))
    return LookupTable(*rows, *rows, np.empty(0, dtype=np.int32), small.layers)


def _nearest(small, cells):
    """By blocks from nothing."""
    shape = -(-np.asarray(GRID.shape) // 2)
    blocks = {int(np.ravel_multi_index(np.array(np.unravel_index(c, GRID.shape)) // 2, shape)) for c in cells}
    return slow_nearest(small.layers, blocks, 8, 5)


def _with_ends(near, edges):
    """(M,) the band of each edge, its ends included."""
    return np.minimum(near.edge, near.node[edges].min(axis=1))


CELLS = st.sets(st.integers(0, GRID.n_cells - 1), max_size=60)


@pytest.mark.parametrize("owners_of_a_set", [0, 2, 32])  # all rows are lists, some, none
@settings(max_examples=40, deadline=None)
@given(frames=st.lists(CELLS, min_size=1, max_size=5))
def test_what_is_near_follows_differences_and_equals_a_recount(small, owners_of_a_set, frames):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(layer_table, "OWNERS_OF_A_SET", owners_of_a_set)
        counts = BlockedCounts(replace(_table(small), layers=replace(small.layers)), 8, 5)
    for frame in frames:
        counts.set_cells(np.array(sorted(frame), dtype=np.int32))
    node, edge = _nearest(small, frames[-1])
    assert np.array_equal(counts.near.node, node) and np.array_equal(counts.near.edge, edge)
    fewer = counts.without(np.array(sorted(frames[-1])[::2], dtype=np.int32))
    node_left, edge_left = _nearest(small, sorted(frames[-1])[1::2])
    assert np.array_equal(fewer.near.node, node_left) and np.array_equal(fewer.near.edge, edge_left)
    assert np.array_equal(counts.near.node, node) and np.array_equal(counts.near.edge, edge)


def test_the_last_owners_may_be_near_nothing(small):
    """No row names them, so the sets end before them."""
    counts = BlockedCounts(_table(small), 8 + 70, 5 + 200)
    counts.set_cells(np.arange(0, GRID.n_cells, 7, dtype=np.int32))
    for bands, named in ((counts.near.node, 8), (counts.near.edge, 5)):
        assert np.all(bands[named:] == small.layers.n_bands) and np.any(bands[:named] < small.layers.n_bands)


@settings(max_examples=40, deadline=None)
@given(CELLS, CELLS)
def test_more_cells_never_raise_a_band(small, some, more):
    counts = BlockedCounts(_table(small), 8, 5)
    counts.set_cells(np.array(sorted(some), dtype=np.int32))
    node, edge = counts.near.node.copy(), _with_ends(counts.near, small.edges)
    counts.set_cells(np.array(sorted(some | more), dtype=np.int32))
    assert np.all(counts.near.node <= node) and np.all(_with_ends(counts.near, small.edges) <= edge)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(*(st.integers(-8, 40) for _ in range(3)), *(st.integers(1, 30) for _ in range(3))), max_size=4))
def test_enclosed_cells_change_no_band(bench, small, boxes):
    swept = [set(cells_of_pose(small.arm, GRID, q, safety_m=0.02).tolist()) for q in small.q]
    table = replace(_table(small), unavoidable=np.array(sorted(set.intersection(*swept)), dtype=np.int32))
    full = np.zeros(GRID.shape, dtype=bool)
    for x, y, z, nx, ny, nz in boxes:
        full[max(0, x) : max(0, x + nx), max(0, y) : max(0, y + ny), max(0, z) : max(0, z + nz)] = True
    outer, every = BlockedCounts(table, 8, 5, GRID.shape), BlockedCounts(table, 8, 5)
    for counts in (outer, every):
        counts.set_cells(np.setdiff1d(np.flatnonzero(full), table.unavoidable).astype(np.int32))
    assert np.array_equal(outer.near.node, every.near.node)
    assert np.array_equal(_with_ends(outer.near, small.edges), _with_ends(every.near, small.edges))


def test_what_is_blocked_is_in_the_lowest_band(bench):
    """At the sizes that ship: 2 cm cells, 4 cm blocks."""
    q, none = bench.free_rad[:6], np.empty((0, 2), dtype=np.int32)
    rules = LayerRules.of(bench.checker.arm, bench.grid, BEYOND_M, 0.04, safety_m=0.02, step_m=0.02)
    table = build_table(bench.checker.arm, bench.grid, q, none, safety_m=0.02, step_m=0.02)
    layers = build_layers(rules, q, none)
    rng = np.random.default_rng(2)
    for cell in rng.choice(np.flatnonzero(np.diff(table.node_offset)), 200, replace=False):
        block = np.ravel_multi_index(np.array(np.unravel_index(cell, bench.grid.shape)) // 2, (40, 40, 25))
        assert set(table.neurons_of(cell)) <= set(layers.neurons_of(block, 0))


@pytest.mark.parametrize("n_new", [0, 2])
def test_grown_layers_equal_those_built_from_nothing(bench, small, n_new):
    ground = Ground(small.arm, GRID, 0.02, STEP_M, small.rules)
    table = build_table(small.arm, GRID, small.q, small.edges, safety_m=0.02, step_m=STEP_M)
    roadmap = Roadmap.of(CognitiveMap(small.q, small.edges), LookupTable(*list(vars(table).values())[:5], small.layers), "gng")
    q_new = bench.free_rad[10 : 10 + n_new]
    new = [[1, 4], *([[k, 8 + k] for k in range(n_new)])]
    result = grown(roadmap, Addition(q_new, np.array(new, dtype=np.int32)), ground).table.layers
    anew = build_layers(small.rules, np.vstack([small.q, q_new]), np.vstack([small.edges, new]).astype(np.int32))
    for name in ("node_offset", "node_owner", "edge_offset", "edge_owner"):
        a, b = getattr(result, name), getattr(anew, name)
        assert a.dtype == b.dtype and np.array_equal(a, b), name


def test_no_layers_cost_nothing(bench):
    counts = NearCounts(NO_LAYERS, 4, 2)
    counts.change(np.arange(5, dtype=np.int32), np.empty(0, dtype=np.int32))
    assert counts.node.tolist() == [0] * 4


def test_too_many_layers_are_refused_with_their_place():
    layers_m = [round(0.01 * (k + 1), 2) for k in range(17)]
    with pytest.raises(ConfigError, match="layers_m"):
        load(None, "planner", PlannerConfig, [f"planner.clearance.layers_m={layers_m}"])
    assert load(None, "planner", PlannerConfig, [f"planner.clearance.layers_m={layers_m[:16]}"]) is not None


def test_surcharges_need_their_layers(bench, small):
    roadmap = Roadmap.of(CognitiveMap(small.q, small.edges), _table(small), "gng")
    with pytest.raises(ValueError, match="2 surcharges for 3 layers"):
        PathFinder(roadmap, bench.checker, [0.5, 0.2])
