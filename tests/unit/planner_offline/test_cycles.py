"""Edges that close useful cycles."""

from __future__ import annotations

import numpy as np
import pytest

from services.planner.core.cognitive_map import CognitiveMap, components
from services.planner.offline.cycles import with_useful_cycles
from tests.support.slow_cycles import slow_cycles


def _is_free(a: np.ndarray, b: np.ndarray) -> bool:
    """A wall at x = 0.5 with a gate above y = 0.7."""
    if (a[0] - 0.5) * (b[0] - 0.5) >= 0.0:
        return True
    return bool(a[1] + (0.5 - a[0]) / (b[0] - a[0]) * (b[1] - a[1]) > 0.7)


def _a_tree(rng: np.random.Generator, n: int) -> CognitiveMap:
    q = rng.uniform(size=(n, 2))
    return CognitiveMap.of(q, np.array([(int(rng.integers(k)), k) for k in range(1, n)]))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(("stretch", "k"), [(1.0, 3), (1.5, 8), (2.0, 5), (3.0, 59)])
def test_as_its_twin(seed: int, stretch: float, k: int) -> None:
    tree = _a_tree(np.random.default_rng(seed), 60)
    more = with_useful_cycles(tree, _is_free, stretch, k)
    assert {tuple(edge) for edge in more.edges.tolist()} == slow_cycles(tree.q_rad, tree.edges, _is_free, stretch, k)
    np.testing.assert_array_equal(more.q_rad, tree.q_rad)


def test_nothing_that_was_there_goes_and_no_new_edge_is_blocked() -> None:
    tree = _a_tree(np.random.default_rng(9), 300)
    more = with_useful_cycles(tree, _is_free, 2.0, 20)
    before, after = ({tuple(edge) for edge in one.edges.tolist()} for one in (tree, more))
    assert before < after
    assert all(_is_free(*tree.q_rad[list(edge)]) for edge in after - before)


def test_parts_that_no_way_joins_are_infinitely_far_apart() -> None:
    two = CognitiveMap.of(np.array([[0.0, 0.0], [0.1, 0.0], [0.0, 0.1], [0.1, 0.1]]), np.array([[0, 1], [2, 3]]))
    joined = with_useful_cycles(two, _is_free, 1e6, 1)
    assert len(np.unique(components(4, joined.edges))) == 1


def test_equal_places_and_few_neurons() -> None:
    one = CognitiveMap.of(np.zeros((3, 2)), np.array([[0, 1], [1, 2]]))
    np.testing.assert_array_equal(with_useful_cycles(one, _is_free, 2.0, 32).edges, [[0, 1], [1, 2]])
