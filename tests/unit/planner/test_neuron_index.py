"""The nearest neurons by index, as by sorting all of them."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import KDTree

from services.planner.core.cognitive_map import CognitiveMap
from services.planner.core.neuron_index import in_order_of_place, index_neurons
from services.planner.kernels.neuron_index import nearest_free


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 700), st.integers(1, 7), st.integers(1, 30), st.booleans())
def test_equals_sorting(seed, n, n_joints, k, coarse):
    rng = np.random.default_rng(seed)
    neurons = rng.normal(size=(n, n_joints))
    if coarse:  # many at equal distances
        neurons = np.round(neurons)
    blocked = (rng.random(n) < 0.4).astype(np.int32)
    q = np.round(rng.normal(size=n_joints)) if coarse else rng.normal(size=n_joints)
    index, distance = np.empty(k, dtype=np.int32), np.empty(k)
    found = nearest_free(index_neurons(neurons), blocked, q, index, distance)
    apart = np.linalg.norm(neurons - q, axis=1)
    free = np.flatnonzero(blocked == 0)
    squared = ((neurons - q) ** 2)[:, 0]
    for j in range(1, n_joints):
        squared = squared + ((neurons - q) ** 2)[:, j]
    expected = free[np.lexsort((free, squared[free]))][:k]
    assert found == len(expected)
    np.testing.assert_array_equal(index[:found], expected)
    np.testing.assert_allclose(distance[:found], apart[expected])


def test_all_in_one_place_and_one_alone():
    for n in (1, 100):
        index, distance = np.empty(3, dtype=np.int32), np.empty(3)
        found = nearest_free(index_neurons(np.zeros((n, 6))), np.zeros(n, dtype=np.int32), np.ones(6), index, distance)
        assert found == min(n, 3) and index[:found].tolist() == list(range(found))


def test_few_are_looked_at():
    """Of 10 000 neurons as a map has them, a question for 24 looks into a fraction of the leaves."""
    rng = np.random.default_rng(1)
    neurons = rng.normal(size=(10_000, 6)) * np.array([1.0, 0.5, 0.5, 0.5, 0.2, 0.5])
    tree = index_neurons(neurons)
    q = neurons[0] + 0.01
    worst = np.sort(np.linalg.norm(neurons - q, axis=1))[23]
    leaves = len(tree.leaf_offset) - 1
    apart = np.maximum(np.maximum(tree.low_rad[-leaves:] - q, q - tree.high_rad[-leaves:]), 0.0)
    assert np.mean(np.linalg.norm(apart, axis=1) <= worst) < 0.35


def test_a_map_in_order_of_place_is_the_same_map_with_near_neurons_together():
    rng = np.random.default_rng(3)
    q = rng.normal(size=(2000, 6))
    _, near = KDTree(q).query(q, k=4)
    learned = CognitiveMap.of(q, np.array([(i, j) for i in range(len(q)) for j in near[i, 1:]]))
    placed = in_order_of_place(learned)

    def ends(m):
        return {tuple(sorted((tuple(m.q_rad[a]), tuple(m.q_rad[b])))) for a, b in m.edges}

    def apart(m):
        return np.median(np.abs(np.diff(m.edges, axis=1)))

    assert ends(placed) == ends(learned) and len(placed.edges) == len(learned.edges)
    assert sorted(map(tuple, placed.q_rad)) == sorted(map(tuple, q))
    assert apart(placed) < 0.25 * apart(learned)
    np.testing.assert_array_equal(in_order_of_place(placed).q_rad, placed.q_rad)
