"""What a map has learned since it was built answers where the rest has no way, and changes nothing where it has one."""

from __future__ import annotations

import itertools
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from services.planner.core.find import PathFinder
from services.planner.core.found import FoundPath
from services.planner.core.growth import Ground, grown
from services.planner.core.learning import LearningRules, learn
from services.planner.core.repair import Repair
from services.planner.core.route import Route
from services.planner.core.two_trees import Bounds, seed_of
from services.planner.core.world import World, no_cells

RULES = LearningRules(0.4, 0.0, 5, 3.0, max_neurons=500, exactly=True)
RANGE = (np.full(6, -np.pi), np.full(6, np.pi))


@pytest.fixture(scope="module")
def learned(bench, cut):
    """The map that a wall cuts, what it answers; the same after it has learned what repair found for the rest; pairs of both kinds."""
    finder, world, pairs = cut
    checker, empty = finder.checker, no_cells(bench.grid)
    ground = Ground(checker.arm, bench.grid, 0.02, 0.01)
    roadmap, old, new, pool = finder.roadmap, [], [], ThreadPoolExecutor(1)
    for start, goal in pairs:
        if isinstance(_route(finder, world, start, goal).find(), FoundPath):
            old.append((start, goal))
            continue
        repair = Repair(finder, world, start, goal[None], RANGE, seed_of(start), Bounds(2_000, connections=2), 1, pool)
        while (found := repair.advance()) is True:
            pass
        if isinstance(found, FoundPath):
            addition = learn(roadmap, found.q_rad, RULES, lambda a, b: checker.segment(empty, a, b))
            roadmap = grown(roadmap, addition, ground)
            new.append((start, goal))
    assert len(old) >= 3 and len(new) >= 3
    counts = roadmap.counts(bench.grid)
    counts.set_cells(world.counts.cells)
    return PathFinder(roadmap, checker), World.of(bench.grid, counts), old, new


def _route(finder, world, start, goal):
    return Route.ask(finder, world, start, goal, "dijkstra")[0]


def test_what_was_learned_is_answered_by_the_map(learned):
    finder, world, _, new = learned
    for start, goal in new:
        found = _route(finder, world, start, goal).find()
        assert isinstance(found, FoundPath) and found.way == "map"
        assert found.neurons.max() >= finder.roadmap.n_built
        assert all(finder.checker.segment(world.cells, a, b) for a, b in itertools.pairwise(found.q_rad))


def test_what_was_answered_before_is_answered_the_same(cut, learned):
    before, before_world, _ = cut
    finder, world, old, _ = learned
    for start, goal in old:
        one = _route(before, before_world, start, goal).find()
        other = _route(finder, world, start, goal).find()
        assert isinstance(one, FoundPath) and isinstance(other, FoundPath)
        assert one.neurons.tobytes() == other.neurons.tobytes() and one.q_rad.tobytes() == other.q_rad.tobytes()


def test_where_all_the_old_ways_are_banned_a_learned_one_is_taken(learned):
    """Pieces of the old way are taken from it one by one: none of them comes back with what was learned."""
    finder, world, old, _ = learned
    n_built, took_over = finder.roadmap.n_built, 0
    for start, goal in old:
        route, banned = _route(finder, world, start, goal), set()
        for _ in range(200):
            found = route.find()
            if not isinstance(found, FoundPath) or found.neurons.max() >= n_built:
                break
            edges = list(itertools.pairwise(found.neurons.tolist()))
            assert not banned & set(edges)
            piece = len(found.neurons) // 2
            banned |= {edges[piece - 1]} if 0 < piece < len(found.neurons) else set()
            route.ban(found, piece)
        took_over += isinstance(found, FoundPath)
        if isinstance(found, FoundPath):
            assert not banned & set(itertools.pairwise(found.neurons.tolist()))
    assert took_over >= 1
