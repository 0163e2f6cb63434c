"""Searches side by side: what is found is what the luckiest of them finds alone, however many threads there are."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from services.planner.core.map_search import MapSearch
from services.planner.core.or_parallel import OrParallel
from services.planner.core.two_trees import Bounds, Known, TwoTrees, no_map, seed_of

RANGE = (np.full(6, -np.pi), np.full(6, np.pi))


def _searches(cut, pair, iterations=2_000):
    finder, world, (start, goal) = cut[0], cut[1], pair
    bounds = Bounds(iterations, slice_iterations=5, nodes=4_000)
    seeds = [seed_of(start, goal, np.array([k])) for k in range(3)]
    ends = (start, goal[None], RANGE)
    searches = [TwoTrees(finder.checker, world.cells, no_map(6), *ends, seed, bounds) for seed in seeds]
    known = Known(finder.roadmap.graph, np.ones_like(world.counts.node), world.counts.edge)  # all blocked: more luck than knowledge
    searches[1] = MapSearch(finder.checker, world.cells, known, *ends, seeds[1], bounds)
    return searches


def _rounds(search):
    rounds = 1
    while not search.advance():
        rounds += 1
    return rounds, search.found()


@pytest.mark.parametrize("n_threads", [1, 3])
def test_the_luckiest_ends_it(cut, n_threads):
    winners = set()
    with ThreadPoolExecutor(n_threads) as pool:
        for pair in cut[2][:8]:
            alone = [_rounds(search) for search in _searches(cut, pair)]
            found_after = [rounds if found is not None else np.inf for rounds, found in alone]
            rounds, found = _rounds(OrParallel(_searches(cut, pair), pool))
            first = int(np.argmin(found_after))
            if found is None:
                assert np.isinf(found_after[first])
                continue
            winners.add(first)
            assert rounds == found_after[first] and found.q_rad.tobytes() == alone[first][1].q_rad.tobytes()
    assert len(winners) > 1, "or this shows nothing"


def test_the_others_join_in_when_the_first_has_been_alone_for_so_long(cut):
    alone_for = 7
    with ThreadPoolExecutor(2) as pool:
        for pair in cut[2][:8]:
            alone = [_rounds(search) for search in _searches(cut, pair)]
            found_after = [rounds if found is not None else np.inf for rounds, found in alone]
            found_after = [found_after[0], *(rounds + alone_for for rounds in found_after[1:])]
            rounds, found = _rounds(OrParallel(_searches(cut, pair), pool, alone_for))
            first = int(np.argmin(found_after))
            if found is not None:
                assert rounds == found_after[first] and found.q_rad.tobytes() == alone[first][1].q_rad.tobytes()


def test_it_is_over_when_all_are(cut):
    one_sample = {"iterations": 1}
    pair = next(pair for pair in cut[2] if all(_rounds(search)[1] is None for search in _searches(cut, pair, **one_sample)))
    with ThreadPoolExecutor(2) as pool:
        searches = _searches(cut, pair, **one_sample)
        side_by_side = OrParallel(searches, pool, rounds_alone=9)
        while not side_by_side.advance():
            pass
        assert side_by_side.found() is None and side_by_side.iterations == len(searches)
