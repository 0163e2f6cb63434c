"""Out of cells that came within the safety distance."""

from __future__ import annotations

import itertools

import coal
import numpy as np
import pytest

from common.robot.pairs import coal_mesh
from services.planner.core.cognitive_map import CognitiveMap
from services.planner.core.find import PathFinder
from services.planner.core.found import NO_NEURON, FoundPath, NotFound
from services.planner.core.lookup import BlockedCounts, build_table
from services.planner.core.roadmap import Roadmap
from services.planner.core.route import Route
from services.planner.core.way_out import WayOut, route_of, steps_out
from services.planner.core.world import LEAVING_SLACK_M, Leaving, World

START = np.array([-0.9, -1.2, 1.3, -1.6, -1.57, 0.0])
VOXEL_M = 0.005  # of the distance grids by which the way out is judged
RANGE = (np.full(6, -np.pi), np.full(6, np.pi))


def _hand_at(bench, offset_m):
    """Cells of a 4 cm cube beside the tool."""
    middle = bench.robot.tool_pose(START)[:3, 3] + np.array(offset_m)
    steps = np.array(list(itertools.product((-0.01, 0.01), repeat=3)))
    return np.unique(bench.grid.cells_of(middle + steps)).astype(np.int32)


def _world(bench, cells, goal):
    """A map of the goal alone, and the world of those cells on it."""
    learned = CognitiveMap(np.array([goal, goal + 0.05]), np.array([[0, 1]], dtype=np.int32))
    table = build_table(bench.checker.arm, bench.grid, learned.q_rad, learned.edges, safety_m=0.02, step_m=0.02)
    counts = BlockedCounts(table, 2, 1)
    counts.set_cells(cells)
    return PathFinder(Roadmap.of(learned, table, "gng"), bench.checker), World.of(bench.grid, counts)


def _gap_m(bench, q, cells):
    """Exact distance of the bare meshes to the nearest middle of a cell."""
    frames = [coal.Transform3s(T[:3, :3].copy(), T[:3, 3].copy()) for T in bench.robot.joint_poses(q[None])[0]]
    point, ask = coal.Sphere(1e-6), coal.DistanceRequest()
    places = [coal.Transform3s(np.eye(3), centre) for centre in cells.centre_m]
    meshes = [(coal_mesh(body), frames[body.joint]) for body in bench.robot.bodies]
    return min(coal.distance(mesh, frame, point, at, ask, coal.DistanceResult()) for mesh, frame in meshes for at in places)


@pytest.fixture(scope="module")
def beside(bench) -> tuple[World, Leaving]:
    _, world = _world(bench, _hand_at(bench, [0.0, 0.065, 0.02]), bench.robot.home_rad)
    leaving = world.leaving(bench.checker, START)
    assert leaving is not None, "the hand is within the safety distance, and touches nothing"
    return world, leaving


def test_a_step_ends_free_and_only_leads_away(bench, beside):
    world, leaving = beside
    steps = list(steps_out(bench.checker, world, leaving, START, *RANGE))
    assert steps
    for step in steps:
        assert not bench.checker.cells_hit(world.cells, step).any()
    for step in steps[:: max(1, len(steps) // 5)]:  # coal takes its time
        gaps = [_gap_m(bench, q, world.cells) for q in np.linspace(START, step, 8)]
        assert min(gaps) >= gaps[0] - LEAVING_SLACK_M - VOXEL_M
    assert all(np.linalg.norm(a - START) <= np.linalg.norm(b - START) + 1e-9 for a, b in itertools.pairwise(steps))


def test_limits_are_kept(bench, beside):
    world, leaving = beside
    q_min, q_max = START - 0.15, START + 0.15
    assert all(np.all((q >= q_min) & (q <= q_max)) for q in steps_out(bench.checker, world, leaving, START, q_min, q_max))


def test_where_no_neuron_can_be_joined_a_step_helps(bench):
    cells = _hand_at(bench, [0.0, 0.06, 0.0])
    rng = np.random.default_rng(4)
    helped = 0
    for goal in START + rng.normal(scale=0.4, size=(100, 6)):
        finder, world = _world(bench, cells, goal)
        leaving = world.leaving(bench.checker, START)
        assert leaving is not None
        straight = Route(finder, leaving.rest, leaving, START, goal, "dijkstra").find()
        way = route_of(finder, world, START, goal, "dijkstra", RANGE)
        if isinstance(way, NotFound) or isinstance(straight, FoundPath):
            continue
        assert isinstance(way, WayOut)
        found = way.find()
        if not isinstance(found, FoundPath):
            continue
        helped += 1
        assert found.neurons[0] == NO_NEURON and found.q_rad.shape == (len(found.neurons) + 2, 6)
        assert leaving.is_way_out(bench.checker, found.q_rad[0], found.q_rad[1])
        assert all(bench.checker.segment(world.cells, a, b) for a, b in itertools.pairwise(found.q_rad[1:]))
        way.ban(found, 0)
        other = way.find()
        assert isinstance(other, NotFound) or not np.array_equal(other.q_rad[1], found.q_rad[1])
    assert helped >= 3
