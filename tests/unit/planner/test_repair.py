"""The search by two trees, against its twin in words, on a small map of the UR3 that a wall cuts in two."""

from __future__ import annotations

import itertools
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from services.planner.core.found import FoundPath
from services.planner.core.repair import ROUNDS_ALONE, Repair, tightened
from services.planner.core.two_trees import FINER, Bounds, TwoTrees, no_map, seed_of
from tests.support.slow_repair import SlowTwoTrees
from tests.support.slow_xoshiro import SlowXoshiro

RANGE = (np.full(6, -np.pi), np.full(6, np.pi))
FEW = Bounds(400, slice_iterations=7, nodes=4_000, connections=6)


def _search(finder, world, known, start, goals, bounds=FEW):
    joint_range = (np.full(6, -np.pi), np.full(6, np.pi))
    return TwoTrees(finder.checker, world.cells, known, start, goals, joint_range, seed_of(start, goals), bounds)


def _solve(search):
    while not search.advance():
        pass
    return search.found()


@pytest.mark.parametrize("on_map", [True, False])
def test_it_equals_its_twin(cut, on_map):
    finder, world, pairs = cut[0], cut[1], cut[2][:12]
    r = finder.roadmap
    known = (r.graph, world.counts.node, world.counts.edge) if on_map else no_map(6)
    solved = 0
    for start, goal in pairs[:6]:
        goals = np.array([goal, goal + 0.02])
        found = _solve(_search(finder, world, known, start, goals))
        nodes = world.counts.node if on_map else np.empty(0, dtype=np.int32)
        rng = SlowXoshiro([int(part) for part in seed_of(start, goals)])
        low, high = np.full(6, -np.pi), np.full(6, np.pi)
        slow = SlowTwoTrees(finder.checker, world.cells, FINER * finder.checker.step_m, r, nodes, world.counts.edge, low, high, rng)
        expected = slow.solve(start, goals, FEW.connections, FEW.iterations)
        assert (found is None) == (expected is None)
        if found is not None:
            solved += 1
            np.testing.assert_allclose(found.q_rad, expected, rtol=0.0, atol=1e-12)
    assert solved >= 3


def test_slices_make_no_difference_and_equal_questions_get_equal_answers(cut):
    finder, world, pairs = cut[0], cut[1], cut[2][:12]
    known = (finder.roadmap.graph, world.counts.node, world.counts.edge)
    for start, goal in pairs:
        answers = []
        for size in (1, 7, 400):
            found = _solve(_search(finder, world, known, start, goal[None], Bounds(400, size, 4_000, 6)))
            answers.append(None if found is None else (found.q_rad.tobytes(), found.neurons.tobytes()))
        assert answers[0] == answers[1] == answers[2]


def test_paths_are_free_and_keep_their_ends_and_get_shorter(cut):
    finder, world, pairs = cut[0], cut[1], cut[2][:12]
    checker, n_solved = finder.checker, 0
    for start, goal in pairs:
        found = _solve(_search(finder, world, no_map(6), start, goal[None], Bounds(2_000, 50)))
        if found is None:
            continue
        n_solved += 1
        tight = tightened(checker, world.cells, found)
        for path in (found, tight):
            np.testing.assert_array_equal(path.q_rad[[0, -1]], [start, goal])
            assert len(path.neurons) == len(path.q_rad) - 2
            assert all(checker.segment(world.cells, a, b) for a, b in itertools.pairwise(path.q_rad))
        length = [np.linalg.norm(np.diff(path.q_rad, axis=0), axis=1).sum() for path in (found, tight)]
        assert length[1] <= length[0] + 1e-9
    assert n_solved >= len(pairs) // 2


def test_bounds_end_it(cut):
    finder, world, pairs = cut[0], cut[1], cut[2][:12]
    slow = [ends for ends in pairs if _solve(_search(finder, world, no_map(6), ends[0], ends[1][None], Bounds(3))) is None]
    start, goal = slow[0]
    none = _search(finder, world, no_map(6), start, goal[None], Bounds(3, slice_iterations=1))
    assert [none.advance() for _ in range(6)] == [False] * 5 + [True], "two roots, three samples"
    assert none.found() is None and none.iterations == 3
    full = _search(finder, world, no_map(6), start, goal[None], Bounds(5_000, nodes=2))
    assert _solve(full) is None


def _repair(finder, world, start, goal, n_searches, iterations=2_000, n_threads=2):
    bounds = Bounds(iterations, slice_iterations=1, nodes=4_000, connections=2)
    pool = ThreadPoolExecutor(n_threads)
    return Repair(finder, world, start, goal[None], RANGE, seed_of(start), bounds, n_searches, pool)


def _repaired(repair):
    slices = 1
    while (found := repair.advance()) is True:
        slices += 1
    return found, slices


def test_of_two_searches_the_luckier_one_answers(cut):
    finder, world, pairs = cut[0], cut[1], cut[2]
    sooner = 0
    for start, goal in pairs:
        alone, slices_alone = _repaired(_repair(finder, world, start, goal, n_searches=1))
        found, slices = _repaired(_repair(finder, world, start, goal, n_searches=2))
        again, _ = _repaired(_repair(finder, world, start, goal, n_searches=2, n_threads=1))
        assert isinstance(found, FoundPath) or not isinstance(alone, FoundPath)
        if isinstance(found, FoundPath):
            assert again.q_rad.tobytes() == found.q_rad.tobytes()
            assert all(finder.checker.segment(world.cells, a, b) for a, b in itertools.pairwise(found.q_rad))
        if isinstance(alone, FoundPath) and found.q_rad.tobytes() != alone.q_rad.tobytes():
            assert slices <= slices_alone + 2, "two slices more at most, of cutting corners"
            sooner += 1
    assert sooner >= 1, "or this shows nothing"


def test_one_of_two_goes_on_alone_as_if_it_had_been(cut):
    finder, world, pairs = cut[0], cut[1], cut[2]
    shown = 0
    for start, goal in pairs:
        repair, n_slices = _repair(finder, world, start, goal, n_searches=2), 1
        while (found := repair.advance()) is True and n_slices < 2 * ROUNDS_ALONE:
            n_slices += 1
        samples = repair.iterations
        repair.alone()
        assert repair.iterations == samples
        if found is not True:
            continue
        found, _ = _repaired(repair)
        first, _ = _repaired(_repair(finder, world, start, goal, n_searches=1))
        both, _ = _repaired(_repair(finder, world, start, goal, n_searches=2))
        expected = [path.q_rad.tobytes() for path in (first, both) if isinstance(path, FoundPath)]  # both: had it been found by then
        assert found.q_rad.tobytes() in expected if isinstance(found, FoundPath) else first is False
        shown += isinstance(found, FoundPath) and isinstance(both, FoundPath) and expected[0] != expected[1]
    assert shown >= 1, "or this shows nothing"


def test_it_begins_again_on_other_samples_until_the_bounds_are_reached(cut):
    finder, world, pairs = cut[0], cut[1], cut[2]
    for start, goal in pairs:
        repair = _repair(finder, world, start, goal, n_searches=2, iterations=300)
        found, _ = _repaired(repair)
        if isinstance(found, FoundPath) and found.way == "repair":
            break
    ways = {found.q_rad.tobytes()}
    while repair.again() and isinstance(other := _repaired(repair)[0], FoundPath):
        ways.add(other.q_rad.tobytes())
    assert len(ways) > 1 and repair.iterations <= 2 * 300


def test_repair_answers_where_the_map_alone_does_not(cut):
    finder, world, pairs = cut[0], cut[1], cut[2][:12]
    ways = set()
    for start, goal in pairs:
        found, _ = _repaired(_repair(finder, world, start, goal, n_searches=1))
        if isinstance(found, FoundPath):
            ways.add(found.way)
            assert all(finder.checker.segment(world.cells, a, b) for a, b in itertools.pairwise(found.q_rad))
            on_map = found.neurons[found.neurons >= 0]
            points = found.q_rad[1:-1][found.neurons >= 0]
            np.testing.assert_array_equal(points, finder.roadmap.neurons_rad[on_map])
    assert "repair" in ways
