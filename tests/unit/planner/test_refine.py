"""Refined paths: shorter, free, with the same ends, and the same each time."""

from __future__ import annotations

import itertools
import time

import numpy as np
import pytest

from services.planner.core.check import HandReach
from services.planner.core.cognitive_map import CognitiveMap
from services.planner.core.find import PathFinder
from services.planner.core.found import FoundPath, path_length
from services.planner.core.lookup import BlockedCounts, LookupTable
from services.planner.core.motion import Ask, Motion, MotionPlanner, Stopwatch
from services.planner.core.roadmap import Roadmap
from services.planner.core.separation import Separation
from services.planner.core.timing import Limits
from services.planner.core.world import World
from services.planner.kernels.reach import reach_of
from services.planner.kernels.refine import refine
from services.planner.kernels.separation import SpeedLaw
from services.planner.kernels.way import line_is_free
from services.planner.kernels.xoshiro import uniform
from services.planner.offline.regions import box_cells
from tests.support.slow_refine import slow_refine

HERE = np.array([-0.9, -1.2, 1.3, -1.6, -1.57, 0.0])
THERE = np.array([0.9, -1.2, 1.3, -1.6, -1.57, 0.0])
RANGE = (np.full(6, -np.pi), np.full(6, np.pi))


@pytest.fixture(scope="module")
def world(bench) -> World:
    """A post in the middle of the straight way."""
    rows = (np.zeros((1, bench.grid.n_cells + 1), dtype=np.int64), np.empty(0, dtype=np.uint16))
    counts = BlockedCounts(LookupTable(*rows, *rows, np.empty(0, dtype=np.int32)), 2, 1)
    counts.set_cells(np.unique(box_cells(bench.grid, np.array([0.3, -0.04, 0.0]), np.array([0.5, 0.04, 0.25]))).astype(np.int32))
    return World.of(bench.grid, counts)


def _detour(bench, world, seed=0):
    """A free path with far more corners than it needs: up, over the post, down."""
    rng = np.random.default_rng(seed)
    lift = np.array([0.0, -0.6, -0.3, 0.3, 0.0, 0.0])
    shares = np.linspace(0.0, 1.0, 9)[:, None]
    path = HERE + shares * (THERE - HERE) + np.sin(np.pi * shares) ** 0.5 * lift
    path[1:-1] += rng.normal(scale=0.12, size=(7, 6))
    path[-1] = THERE
    assert all(bench.checker.segment(world.cells, a, b) for a, b in itertools.pairwise(path)), "the detour is free"
    return path


def _refined(bench, world, path, first, looks, state=(1, 2, 3, 4)):
    c = bench.checker
    buffer, rng = np.empty((len(path) + 40, 6)), np.array(state, dtype=np.uint64)
    buffer[: len(path)] = path
    proven = np.zeros(len(buffer), dtype=np.uint8)
    n = refine(c.arm, c.solids, world.cells, c.safety_m, c.step_m, buffer, proven, len(path), first, looks, rng)
    return buffer[:n], proven[: n - 1]


@pytest.mark.parametrize("first", [0, 1, 3])
def test_the_kernel_equals_its_twin(bench, world, first):
    path = _detour(bench, world)
    state = np.array([1, 2, 3, 4], dtype=np.uint64)
    slow = slow_refine(list(path), first, 60, len(path) + 40, lambda: uniform(state), lambda a, b: bench.checker.segment(world.cells, a, b))
    np.testing.assert_allclose(_refined(bench, world, path, first, 60)[0], slow, rtol=0.0, atol=1e-9)


def test_it_is_much_shorter_free_and_keeps_its_ends(bench, world):
    path = _detour(bench, world)
    refined, proven = _refined(bench, world, path, 1, 200)
    assert proven.any() and not proven[0], "what was not looked at here is not called proven"
    np.testing.assert_array_equal(refined[:2], path[:2])
    np.testing.assert_array_equal(refined[-1], path[-1])
    assert all(bench.checker.segment(world.cells, a, b) for a, b in itertools.pairwise(refined))
    assert not bench.checker.segment(world.cells, refined[0], refined[-1]), "there is something to go round"
    assert path_length(refined) < 0.85 * path_length(path)
    assert path_length(refined) >= np.linalg.norm(THERE - HERE)


def test_a_straight_path_costs_no_look(bench, world):
    path = HERE + np.linspace(0.0, 0.2, 5)[:, None] * (THERE - HERE)
    np.testing.assert_array_equal(_refined(bench, world, path, 0, 50)[0], path)


def test_shortcuts_keep_the_room_that_is_asked_for(bench, world):
    path, room_m = _detour(bench, world), 0.03
    found, finder = FoundPath(np.full(7, -1, dtype=np.int32), path), _planner(bench, 200).finder
    wide = finder.refined(world, found, 200, room_m)
    assert wide.proven.any() and path_length(wide.q_rad) < path_length(path)
    c = bench.checker
    is_free = [
        line_is_free(c.arm, c.solids, world.cells, c.safety_m + room_m, c.step_m, a, b)
        for (a, b), proven in zip(itertools.pairwise(wide.q_rad), wide.proven, strict=True)
        if proven
    ]
    assert all(is_free)
    assert path_length(finder.refined(world, found, 200).q_rad) < path_length(wide.q_rad), "which costs some length"


def test_what_repair_and_fallback_found_is_not_looked_at_again(bench, world):
    path, finder = _detour(bench, world), _planner(bench, 0).finder
    by_map, by_fallback = (
        finder.cut_corners(world, FoundPath(np.full(7, -1, dtype=np.int32), path, way=way), 0) for way in ("map", "fallback")
    )
    assert by_map.proven.tolist() == [1, 0, 0, 0, 0, 0, 0, 1], "the map's connections were"
    assert by_fallback.proven.all()


def _slowed(bench):
    """A law under which to pass close by takes much longer."""
    law = SpeedLaw(0.0, 0.1, 2.0, 0.1)
    return Separation(bench.checker.arm, reach_of(bench.checker.arm.grids, 0.15), law, law)


def test_what_is_shorter_but_much_slower_gives_way_to_shortcuts_with_more_room(bench, world):
    path = _detour(bench, world, 6)
    found, ask, watch = FoundPath(np.full(7, -1, dtype=np.int32), path), Ask(HERE, THERE), Stopwatch(time.perf_counter_ns)
    planner = _planner(bench, 200, _slowed(bench))
    first = planner.along(world, ask, found, watch)
    assert first is not None
    shortest = planner.finder.refined(world, found, 200).q_rad
    tight = planner.along(world, ask, FoundPath(np.full(len(shortest) - 2, -1, dtype=np.int32), shortest), watch)
    refined = planner.refined(world, ask, first, watch)
    assert tight is not None and tight.curve.duration_s > 1.1 * first.curve.duration_s, "or this shows nothing"
    assert refined.refined and tight.length_rad < refined.length_rad < first.length_rad
    assert refined.curve.duration_s <= 1.1 * first.curve.duration_s


def _planner(bench, looks, separation=None):
    learned = CognitiveMap(np.array([HERE, THERE]), np.array([[0, 1]], dtype=np.int32))
    rows = (np.zeros((1, bench.grid.n_cells + 1), dtype=np.int64), np.empty(0, dtype=np.uint16))
    roadmap = Roadmap.of(learned, LookupTable(*rows, *rows, np.empty(0, dtype=np.int32)), "gng")
    hand, limits = HandReach(0.25, 0.15, np.full(6, 5.0)), Limits(np.full(6, 2.0), np.full(6, 5.0))
    return MotionPlanner(
        PathFinder(roadmap, bench.checker), limits, hand, RANGE, shortcut_checks=0, refine_looks=looks, separation=separation
    )


def test_a_refined_motion_is_quicker_free_the_same_twice_and_says_so(bench, world):
    path = _detour(bench, world)
    found, ask = FoundPath(np.full(7, -1, dtype=np.int32), path), Ask(HERE, THERE)
    planner = _planner(bench, 200)
    first = planner.along(world, ask, found, Stopwatch(time.perf_counter_ns))
    assert isinstance(first, Motion) and not first.refined
    watch = Stopwatch(time.perf_counter_ns)
    one, two = (planner.refined(world, ask, first, watch) for _ in range(2))
    assert one.refined and one.smoothing.endswith("refined") and watch.ms["refine"] > 0.0
    assert one.curve.q_rad.tobytes() == two.curve.q_rad.tobytes() and one.curve.t_s.tobytes() == two.curve.t_s.tobytes()
    assert one.curve.duration_s < first.curve.duration_s and one.length_rad < first.length_rad
    checker = bench.checker
    assert checker.curve_meets(world.cells, one.curve, safety_m=checker.safety_m - checker.step_m / 2) is None
    np.testing.assert_allclose(one.curve.q_rad[[0, -1]], [HERE, THERE], rtol=0.0, atol=1e-12)


def test_in_motion_by_the_papers_rules_and_without_looks_the_first_answer_stays(bench, world):
    path = _detour(bench, world)
    found, watch = FoundPath(np.full(7, -1, dtype=np.int32), path), Stopwatch(time.perf_counter_ns)
    first = _planner(bench, 200).along(world, Ask(HERE, THERE), found, watch)
    assert first is not None
    for planner, ask in (
        (_planner(bench, 0), Ask(HERE, THERE)),
        (_planner(bench, 200), Ask(HERE, THERE, np.full(6, 0.1))),
        (_planner(bench, 200), Ask(HERE, THERE, rules="paper")),
    ):
        assert planner.refined(world, ask, first, watch) is first
