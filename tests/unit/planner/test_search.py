from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import KDTree

from services.planner.core.cognitive_map import CognitiveMap
from services.planner.core.find import FREE_OF_CHARGE, SEARCHES
from services.planner.core.lookup import LookupTable
from services.planner.core.near import Near
from services.planner.core.roadmap import Roadmap
from services.planner.kernels.bidirectional import both_ends
from services.planner.kernels.buckets import queue_length
from services.planner.kernels.search import NOT_FOUND, best_first, breadth_first
from tests.support.slow_planner import slow_dijkstra


def _roadmap(n, seed, spread=1.0):
    q = np.random.default_rng(seed).normal(size=(n, 3)) * spread
    _, near = KDTree(q).query(q, k=4)
    learned = CognitiveMap.of(q, np.array([(i, j) for i in range(n) for j in near[i, 1:]]))
    empty = LookupTable(*(np.zeros((1, 2), dtype=np.int64), np.empty(0, dtype=np.uint16)) * 2, np.empty(0, dtype=np.int32))
    return Roadmap.of(learned, empty, "test")


def _shortest(r, search, node, edge, starts, goals, q_goal, near=FREE_OF_CHARGE):
    """Path or None, its cost, neurons settled; by one of ``SEARCHES`` that finds shortest paths."""
    n, m = r.n_neurons, r.n_edges
    path = np.empty(n, dtype=np.int32)
    graph = (r.adj_offset, r.adj_node, r.adj_edge, r.adj_length, node, edge, near)
    ends = [np.array(list(part), dtype=kind) for d in (starts, goals) for part, kind in ((d, np.int32), (d.values(), np.float64))]
    if search == "bidirectional":
        size = max(len(starts), len(goals)) + 2 * m + n + 1
        scratch = [np.empty((2, k), dtype=kind) for k in (n, size) for kind in (np.float64, np.int32)]
        k, cost, settled = both_ends(*graph, *ends, *scratch, path)
    else:
        size = len(starts) + n + int(np.diff(r.adj_offset).max())  # no more room than it says it needs: it must tidy up
        scratch = [np.empty(n), np.empty(n, dtype=np.int32), np.empty(size), np.empty(queue_length(size), dtype=np.int32)]
        k, cost, settled = best_first(r.neurons_rad, *graph, *ends, q_goal, search == "astar", *scratch, path)
    return (None if k == NOT_FOUND else path[:k]), cost, settled


SHORTEST = ("dijkstra", "astar", "bidirectional")


def test_every_search_is_compared_here():
    assert {*SHORTEST, "wavefront"} == set(SEARCHES)


@settings(max_examples=120, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.0, 0.6), st.sampled_from(SHORTEST), st.floats(0.0, 0.3), st.sampled_from([0.05, 1.0, 30.0]))
def test_costs_equal_the_slow_twin(seed, share_blocked, search, share_banned, spread):
    """Also where all keys fall into one or two buckets, and where they reach far beyond the last one."""
    r = _roadmap(80, seed, spread)
    rng = np.random.default_rng(seed)
    node = (rng.random(80) < share_blocked).astype(np.int32)
    edge = (rng.random(r.n_edges) < share_blocked / 3).astype(np.int32)
    q_goal = rng.normal(size=3) * spread
    starts = {int(k): float(rng.random()) for k in rng.choice(80, 6, replace=False)}
    goals = {int(k): float(np.linalg.norm(r.neurons_rad[k] - q_goal)) for k in rng.choice(80, 6, replace=False)}
    for joins in (starts, goals):
        joins.update({k: np.inf for k in joins if rng.random() < share_banned})  # as the finder bans a connection
    path, cost, _ = _shortest(r, search, node, edge, starts, goals, q_goal)
    free = {
        (int(a), int(b)): float(length)
        for (a, b), length, e in zip(r.edges, np.linalg.norm(np.diff(r.neurons_rad[r.edges], axis=1)[:, 0], axis=1), edge, strict=True)
        if not (node[a] or node[b] or e)
    }
    open_starts = {k: c for k, c in starts.items() if not node[k]}
    expected = slow_dijkstra(80, free, open_starts, {k: c for k, c in goals.items() if not node[k]})
    if path is None:
        assert expected == np.inf == cost
        return
    assert cost == pytest.approx(expected, abs=1e-9)
    walked = starts[path[0]] + goals[path[-1]] + np.linalg.norm(np.diff(r.neurons_rad[path], axis=0), axis=1).sum()
    assert walked == pytest.approx(cost, abs=1e-9)
    assert all((min(a, b), max(a, b)) in free for a, b in itertools.pairwise(path))


def _near(r, rng, share, weights):
    """Some neurons and edges with something in one band or another."""
    bands = (np.where(rng.random(k) < share, rng.integers(0, len(weights), k), len(weights)) for k in (r.n_neurons, r.n_edges))
    return Near(*(band.astype(np.uint8) for band in bands), np.array([*(1.0 + np.array(weights)), 1.0]))


@settings(max_examples=120, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.0, 0.4), st.sampled_from([(0.5, 0.4, 0.25), (3.0,), (2.0, 0.0)]))
def test_all_searches_find_the_way_of_least_weighed_cost(seed, share, weights):
    r, rng = _roadmap(80, seed), np.random.default_rng(seed)
    node, edge = (rng.random(80) < 0.1).astype(np.int32), np.zeros(r.n_edges, dtype=np.int32)
    near = _near(r, rng, share, weights)
    q_goal = rng.normal(size=3)
    starts = {int(k): float(rng.random()) for k in rng.choice(80, 6, replace=False)}
    goals = {int(k): float(np.linalg.norm(r.neurons_rad[k] - q_goal)) for k in rng.choice(80, 6, replace=False)}

    def cost_of(e, a, b):
        band = min(near.node[a], near.node[b], near.edge[e])
        return float(np.linalg.norm(r.neurons_rad[a] - r.neurons_rad[b])) * (1.0 + [*weights, 0.0][band])

    free = {(int(a), int(b)): cost_of(e, a, b) for e, (a, b) in enumerate(r.edges) if not (node[a] or node[b])}
    expected = slow_dijkstra(80, free, *({k: c for k, c in joins.items() if not node[k]} for joins in (starts, goals)))
    for search in SHORTEST:
        path, cost, _ = _shortest(r, search, node, edge, starts, goals, q_goal, near)
        if path is None:
            assert expected == np.inf == cost
            continue
        walked = sum(free[min(a, b), max(a, b)] for a, b in itertools.pairwise(path.tolist()))
        assert cost == pytest.approx(expected, abs=1e-9) == starts[path[0]] + goals[path[-1]] + walked


@pytest.mark.parametrize("search", SHORTEST)
def test_one_neuron_that_joins_both_ends_is_a_path(search):
    r = _roadmap(50, 3)
    node, edge = np.zeros(50, dtype=np.int32), np.zeros(r.n_edges, dtype=np.int32)
    q_goal = r.neurons_rad[7]
    path, cost, _ = _shortest(r, search, node, edge, {7: 0.25}, {7: 0.0}, q_goal)
    assert path.tolist() == [7]
    assert cost == 0.25
    node[7] = 1
    assert _shortest(r, search, node, edge, {7: 0.25}, {7: 0.0}, q_goal)[0] is None


@pytest.mark.parametrize("search", ["astar", "bidirectional"])
def test_it_settles_fewer_than_dijkstra_at_equal_cost(search):
    r = _roadmap(2000, 1)
    none, no_edge = np.zeros(2000, dtype=np.int32), np.zeros(r.n_edges, dtype=np.int32)
    start, goal = 0, int(np.argmax(np.linalg.norm(r.neurons_rad - r.neurons_rad[0], axis=1)))
    middle = int(np.argmin(np.linalg.norm(r.neurons_rad - r.neurons_rad[[start, goal]].mean(axis=0), axis=1)))
    plain, better = (_shortest(r, name, none, no_edge, {start: 0.0}, {middle: 0.0}, r.neurons_rad[middle]) for name in ("dijkstra", search))
    assert plain[1] == pytest.approx(better[1], abs=1e-12)
    assert better[2] < plain[2]


def _breadth_first(r, node, edge, starts, goals):
    n = r.n_neurons
    path = np.empty(n, dtype=np.int32)
    scratch = [np.empty(n, dtype=np.int32) for _ in range(3)]
    k, hops, _ = breadth_first(
        r.adj_offset, r.adj_node, r.adj_edge, node, edge, np.array(list(starts), dtype=np.int32), np.zeros(len(starts)),
        np.array(list(goals), dtype=np.int32), np.zeros(len(goals)), *scratch, path,
    )  # fmt: skip
    return (None if k == NOT_FOUND else path[:k]), hops


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.0, 0.6))
def test_wavefront_takes_the_fewest_neurons(seed, share_blocked):
    r = _roadmap(80, seed)
    rng = np.random.default_rng(seed)
    node = (rng.random(80) < share_blocked).astype(np.int32)
    edge = np.zeros(r.n_edges, dtype=np.int32)
    start, goal = (int(k) for k in rng.choice(80, 2, replace=False))
    path, hops = _breadth_first(r, node, edge, [start], [goal])
    ones = {(int(a), int(b)): 1.0 for a, b in r.edges if not (node[a] or node[b])}
    expected = np.inf if node[start] or node[goal] else slow_dijkstra(80, ones, {start: 0.0}, {goal: 0.0})
    assert hops == expected
    assert path is None if expected == np.inf else len(path) == expected + 1


@pytest.mark.parametrize("search", SHORTEST)
def test_equal_questions_equal_answers(search):
    r = _roadmap(300, 2)
    none, no_edge = np.zeros(300, dtype=np.int32), np.zeros(r.n_edges, dtype=np.int32)
    answers = [_shortest(r, search, none, no_edge, {5: 0.1, 9: 0.1}, {200: 0.0}, r.neurons_rad[200])[0].tolist() for _ in range(3)]
    assert answers[0] == answers[1] == answers[2]
