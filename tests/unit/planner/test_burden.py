"""A map under a payload: its rows and layers against a table from nothing and brute force, what is barred against the one check."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.geometry.grid import Grid
from common.robot.model import RobotModel
from common.robot.payload import Payload, with_payload
from services.planner.core.arm import arm_of, solids_of
from services.planner.core.burden import Burden, BurdenGround, _Union, last_body_alone
from services.planner.core.check import Checker
from services.planner.core.cognitive_map import CognitiveMap
from services.planner.core.growth import Addition, Ground, grown
from services.planner.core.layers import LayerRules, build_layers
from services.planner.core.lookup import BlockedCounts, build_table, cells_of_pose
from services.planner.core.roadmap import Roadmap
from services.planner.core.world import no_cells
from services.planner.kernels.collision import FREE, Arm
from services.planner.kernels.merging import count_unions, fill_unions
from services.planner.kernels.moves import segment_steps
from tests.support.cell import ur3_cell
from tests.support.slow_layers import slow_pose_bands
from tests.support.slow_merging import slow_union
from tests.support.slow_planner import slow_pose_cells

BOX = Payload((0.06, 0.12, 0.16), (0.01, 0.0, 0.06), (0.0, 0.0, 0.3827, 0.9239))
GRID = Grid((-0.8, -0.8, 0.0), (40, 40, 25), 0.04)
SAFETY_M, STEP_M = 0.02, 0.02
BEYOND_M, BLOCK_M = [0.02, 0.05, 0.10], 0.08
ROWS_OF_NODES = ("node_offset", "node_owner")
ROWS_OF_EDGES = ("edge_offset", "edge_owner")
N = 160


@dataclass(frozen=True, eq=False)
class Loaded:
    """A small map without and with the box, and the checkers of both arms."""

    robot: RobotModel
    bare: Roadmap
    held: Roadmap
    burden: Burden
    arm: Checker
    bare_arm: Checker
    ground: Ground
    bare_ground: Ground


def _ground(arm: Arm) -> Ground:
    return Ground(arm, GRID, SAFETY_M, STEP_M, LayerRules.of(arm, GRID, BEYOND_M, BLOCK_M, safety_m=SAFETY_M, step_m=STEP_M))


def _from_nothing(ground: Ground, learned: CognitiveMap) -> Roadmap:
    assert ground.layers is not None
    table = build_table(ground.arm, GRID, learned.q_rad, learned.edges, safety_m=SAFETY_M, step_m=STEP_M)
    return Roadmap.of(learned, replace(table, layers=build_layers(ground.layers, learned.q_rad, learned.edges)), "gng")


@pytest.fixture(scope="module")
def loaded(bench) -> Loaded:
    robot = with_payload(bench.robot, BOX)
    arm = arm_of(robot, static_margin_m=0.01, self_margin_m=0.005)
    rng = np.random.default_rng(5)
    q = np.empty((N, 6))
    q[::2] = bench.free_rad[: N // 2]
    q[1::2] = q[::2] + rng.normal(scale=0.1, size=(N // 2, 6))
    edges = np.array([[k, k + 1] for k in range(0, N, 2)], dtype=np.int32)
    ground, bare_ground, solids = _ground(arm), _ground(bench.checker.arm), solids_of(ur3_cell().static)
    bare = _from_nothing(bare_ground, CognitiveMap(q, edges))
    burden = Burden.of(bare, BurdenGround.of(ground, solids))
    names = [body.name for body in robot.bodies]
    checker = Checker(arm, solids, safety_m=SAFETY_M, step_m=STEP_M, body_names=names, solid_names=[s.name for s in ur3_cell().static])
    return Loaded(robot, bare, burden.joined(bare), burden, checker, bench.checker, ground, bare_ground)


def _rows_of(offset, owner, k) -> set[int]:
    rows = np.repeat(np.arange(GRID.n_cells), np.diff(offset[0]))
    return set(rows[owner == k].tolist())


def test_neurons_have_the_rows_of_a_table_that_is_made_from_nothing_with_the_box(loaded: Loaded) -> None:
    table, bare = loaded.held.table, loaded.bare.table
    anew = _from_nothing(loaded.ground, CognitiveMap(loaded.held.neurons_rad, loaded.held.edges)).table
    for name in (*ROWS_OF_NODES, "unavoidable"):
        assert np.array_equal(getattr(table, name), getattr(anew, name)), name
    for name in (*ROWS_OF_NODES, "beyond_m", "cells_shape", "block_cells"):
        assert np.array_equal(getattr(table.layers, name), getattr(anew.layers, name)), name
    assert table.node_owner.dtype == anew.node_owner.dtype and len(table.node_owner) > len(bare.node_owner) + 500
    assert table.layers.node_owner.dtype == anew.layers.node_owner.dtype
    assert np.count_nonzero(_node_bands(loaded.held) < _node_bands(loaded.bare)) > 500


def _node_bands(roadmap: Roadmap) -> np.ndarray:
    """(N, n_blocks) the band of each neuron in each block."""
    return _bands_of(roadmap, "node", roadmap.n_neurons)


def _edge_bands(roadmap: Roadmap) -> np.ndarray:
    """(M, n_blocks) the band of each edge in each block, its ends included."""
    node = _node_bands(roadmap)
    return np.minimum(_bands_of(roadmap, "edge", roadmap.n_edges), np.minimum(node[roadmap.edges[:, 0]], node[roadmap.edges[:, 1]]))


def _bands_of(roadmap: Roadmap, of: str, n: int) -> np.ndarray:
    layers = roadmap.table.layers
    offset, owner = getattr(layers, f"{of}_offset"), getattr(layers, f"{of}_owner")
    entry = np.repeat(np.arange(offset.shape[1] - 1), np.diff(offset[0]))
    bands = np.full((n, layers.n_blocks), layers.n_bands)
    assert len(np.unique(np.stack([owner.astype(int), entry // layers.n_bands]), axis=1).T) == len(owner), "once in a block's rows"
    bands[owner, entry // layers.n_bands] = entry % layers.n_bands
    return bands


def test_no_distance_is_told_larger_than_it_is(loaded: Loaded) -> None:
    """By the slow twin, with arm and box: neurons, and points between the samples of edges."""
    rules = loaded.ground.layers
    assert rules is not None
    origin, shape, edge_m = rules.blocks
    centres = origin + (np.stack(np.unravel_index(np.arange(np.prod(shape)), shape), axis=-1) + 0.5) * edge_m
    node, edge = _node_bands(loaded.held), _edge_bands(loaded.held)

    def brute(q: np.ndarray, within_m: np.ndarray) -> np.ndarray:
        return slow_pose_bands(loaded.arm.arm, rules.reach, loaded.robot.joint_poses(q[None])[0], centres, edge_m / 2, within_m)

    for k in (0, 7):
        assert np.array_equal(node[k], brute(loaded.held.neurons_rad[k], rules.within_m))
    R, T = np.empty((2, 7, 3, 3)), np.empty((2, 7, 3))
    for e in (0, 5):
        a, b = loaded.held.neurons_rad[loaded.held.edges[e]]
        n = segment_steps(loaded.arm.arm, a, b - a, STEP_M, R, T)
        for share in np.linspace(0.0, 1.0, 2 * n + 1)[1::2]:  # the middles of the finest steps: half a step from a sample at most
            assert np.all(edge[e] <= brute(a + (b - a) * share, rules.within_m - STEP_M))
    assert np.any(edge < np.minimum(node[loaded.held.edges[:, 0]], node[loaded.held.edges[:, 1]]))


def test_a_box_on_a_map_that_grows_is_the_box_on_the_grown_map(loaded: Loaded, bench) -> None:
    n = loaded.bare.n_neurons
    q = np.vstack([bench.free_rad[-3:], loaded.bare.neurons_rad[:1] + 0.05])
    edges = np.array([[0, n], [n, n + 1], [n + 1, n + 2], [0, n + 3], [3, 8]], dtype=np.int32)
    larger = grown(loaded.bare, Addition(q, edges), loaded.bare_ground)
    by_steps = loaded.burden.on(larger)
    anew = Burden.of(larger, loaded.burden.ground)
    one, other = by_steps.joined(larger).table, anew.joined(larger).table
    for name in (*ROWS_OF_NODES, *ROWS_OF_EDGES, "unavoidable", "barred_nodes", "barred_edges"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name
    for name in (*ROWS_OF_NODES, *ROWS_OF_EDGES):
        assert np.array_equal(getattr(one.layers, name), getattr(other.layers, name)), name
    assert by_steps.on(larger) is by_steps
    assert np.array_equal(by_steps.on(loaded.bare).joined(loaded.bare).table.node_owner, loaded.held.table.node_owner)  # not a larger one


def test_nothing_that_the_box_sweeps_is_missing(loaded: Loaded) -> None:
    table, half_m = loaded.held.table, GRID.resolution_m / 2
    centres = GRID.centres(np.arange(GRID.n_cells))
    for k in range(6):
        frames = loaded.robot.joint_poses(loaded.held.neurons_rad[k][None])[0]
        brute = set(np.flatnonzero(slow_pose_cells(loaded.arm.arm, frames, centres, half_m, SAFETY_M)).tolist())
        assert _rows_of(table.node_offset, table.node_owner, k) == brute - set(table.unavoidable.tolist())


def test_edges_have_what_each_body_sweeps_at_its_own_steps(loaded: Loaded) -> None:
    table, q = loaded.held.table, loaded.held.neurons_rad
    box = last_body_alone(loaded.arm.arm)
    R, T = np.empty((2, 7, 3, 3)), np.empty((2, 7, 3))
    unavoidable = set(table.unavoidable.tolist())
    for e in range(6):
        a, b = q[loaded.held.edges[e, 0]], q[loaded.held.edges[e, 1]]
        swept: set[int] = set()
        for arm in (loaded.bare_arm.arm, box):
            n = segment_steps(arm, a, b - a, STEP_M, R, T)
            for s in range(1, n):
                swept |= set(cells_of_pose(arm, GRID, a + (b - a) * s / n, safety_m=SAFETY_M).tolist())
        ends = {cell for q_end in (a, b) for cell in cells_of_pose(loaded.arm.arm, GRID, q_end, safety_m=SAFETY_M).tolist()}
        row = _rows_of(table.edge_offset, table.edge_owner, e)
        assert row <= swept - unavoidable
        assert (row | ends) - unavoidable == (swept | ends) - unavoidable  # an edge is blocked with its ends: their cells may be missing


def test_what_the_box_would_hit_is_barred_and_stays_so(loaded: Loaded) -> None:
    nothing, table = no_cells(GRID), loaded.held.table
    held, bare = ([arm.pose(nothing, q)[0] == FREE for q in loaded.held.neurons_rad] for arm in (loaded.arm, loaded.bare_arm))
    poses = np.array(bare) & ~np.array(held)
    assert 0 < poses.sum() < N
    assert set(np.flatnonzero(poses)) <= set(table.barred_nodes.tolist())
    for k in table.barred_nodes:
        assert loaded.arm.pose(nothing, loaded.held.neurons_rad[k])[0] != FREE
    for e, (a, b) in enumerate(loaded.held.edges):
        ends_free = not {a, b} & set(table.barred_nodes.tolist())
        free = loaded.arm.segment(nothing, loaded.held.neurons_rad[a], loaded.held.neurons_rad[b])
        if ends_free and loaded.bare_arm.segment(nothing, loaded.held.neurons_rad[a], loaded.held.neurons_rad[b]):
            assert (e in table.barred_edges) is not free
    counts = BlockedCounts(table, N, loaded.held.n_edges)
    cells = np.flatnonzero(np.diff(table.node_offset[0]))[::7].astype(np.int32)
    counts.set_cells(cells)
    assert counts.n_blocked > len(table.barred_nodes)
    assert np.all(counts.without(cells).node[table.barred_nodes] == 1)
    counts.set_cells(cells[:0])
    assert np.array_equal(np.flatnonzero(counts.node), table.barred_nodes)
    assert np.array_equal(np.flatnonzero(counts.edge), table.barred_edges)
    n_bands = table.layers.n_bands
    assert np.all(counts.near.node == n_bands) and np.all(counts.near.edge == n_bands)


@settings(max_examples=25, deadline=None)
@given(st.sets(st.integers(0, GRID.n_cells - 1), max_size=80))
def test_a_box_never_frees_anything(loaded: Loaded, cells: set[int]) -> None:
    blocked = []
    for roadmap in (loaded.bare, loaded.held):
        counts = BlockedCounts(roadmap.table, N, roadmap.n_edges)
        counts.set_cells(np.setdiff1d(np.array(sorted(cells), dtype=np.int32), loaded.held.table.unavoidable))
        ends = counts.node[roadmap.edges].max(axis=1, initial=0)
        blocked.append((counts.node > 0, (counts.edge > 0) | (ends > 0)))
    assert not np.any(blocked[0][0] & ~blocked[1][0]) and not np.any(blocked[0][1] & ~blocked[1][1])


ROWS = st.lists(st.sets(st.integers(0, 30), max_size=8).map(sorted), min_size=6, max_size=6)


@settings(max_examples=100, deadline=None)
@given(ROWS, ROWS, st.sampled_from([1, 2, 3]), st.sets(st.integers(0, 5)))
def test_unions_equal_their_slow_twin(a: list[list[int]], b: list[list[int]], n_bands: int, empty: set[int]) -> None:
    def flat(rows: list[list[int]]) -> tuple[np.ndarray, np.ndarray]:
        return np.cumsum([0, *map(len, rows)]), np.array([k for row in rows for k in row], dtype=np.uint16)

    counts = np.empty(6, dtype=np.int64)
    count_unions(*flat(a), *flat(b), n_bands, np.full(31, -1), counts)
    wanted = slow_union(a, b, n_bands)
    assert counts.tolist() == [len(row) for row in wanted]
    if n_bands == 1:
        counts[list(empty)] = 0
        wanted = [[] if row in empty else owners for row, owners in enumerate(wanted)]
    offset = np.concatenate([[0], np.cumsum(counts)])
    owner = np.empty(offset[-1], dtype=np.uint16)
    fill_unions(*flat(a), *flat(b), n_bands, np.full(31, -1), offset, owner)
    assert owner.tolist() == [k for row in wanted for k in row]


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 3), st.integers(1, 3))
def test_rows_of_two_tables_are_joined_page_by_page(seed: int, n_pages: int, n_bands: int) -> None:
    """An owner is in the lowest band alone in which either table has it; the same numbers in two pages are two owners."""
    rng, n_blocks, owners = np.random.default_rng(seed), 4, 6
    shape = (n_pages, n_blocks, owners)
    bands = [np.where(rng.random(shape) < 0.5, rng.integers(0, n_bands, shape), n_bands) for _ in range(2)]

    def table(band: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rows = [[np.flatnonzero(block == k) for block in page for k in range(n_bands)] for page in band]
        ends = np.cumsum([len(row) for page in rows for row in page]).reshape(n_pages, -1)
        offset = np.concatenate([np.concatenate([[0], ends[:-1, -1]])[:, None], ends], axis=1)
        return offset.astype(np.int64), np.concatenate([row for page in rows for row in page]).astype(np.uint16)

    offset, owner = _Union(table(bands[0]), table(bands[1]), n_bands).rows()
    expected = table(np.minimum(*bands))
    assert np.array_equal(offset, expected[0]) and np.array_equal(owner, expected[1]) and owner.dtype == np.uint16
