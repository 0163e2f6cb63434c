"""Pruning in a plane: a wall with a gap, checks that anyone can see through."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import KDTree

from services.planner.core.cognitive_map import CognitiveMap, components, statistics
from services.planner.offline.pruning import (
    _nearest_outside,
    fill_up,
    join_components,
    largest_component,
    prune,
    prune_lattice,
    without_collisions,
)


def pose_is_free(q: np.ndarray) -> bool:
    return not (0.45 < q[0] < 0.55 and not 0.4 < q[1] < 0.6)


def motion_is_free(a: np.ndarray, b: np.ndarray) -> bool:
    return all(pose_is_free(a + t * (b - a)) for t in np.linspace(0, 1, 200))


def lattice(n: int = 11) -> CognitiveMap:
    number = np.arange(n * n).reshape(n, n)
    edges = np.vstack(
        [np.stack([number[:-1].ravel(), number[1:].ravel()], 1), np.stack([number[:, :-1].ravel(), number[:, 1:].ravel()], 1)]
    )
    x, y = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n), indexing="ij")
    return CognitiveMap.of(np.stack([x.ravel(), y.ravel()], axis=1), edges)


def all_free(cognitive_map: CognitiveMap) -> bool:
    q = cognitive_map.q_rad
    return all(pose_is_free(p) for p in q) and all(motion_is_free(q[a], q[b]) for a, b in cognitive_map.edges)


def test_what_collides_goes_and_nothing_else() -> None:
    kept = without_collisions(lattice(), pose_is_free, motion_is_free)
    assert kept.n_neurons == 121 - 10  # the column x = 0.5, but for y = 0.5
    assert all_free(kept)
    assert len(kept.edges) == 220 - 10 - 20  # ten along the wall, two across it in each of ten rows


def test_components_are_joined_by_free_bridges_only() -> None:
    apart = without_collisions(lattice(), pose_is_free, motion_is_free)
    gap = int(np.flatnonzero(np.all(np.isclose(apart.q_rad, 0.5), axis=1))[0])
    cut = CognitiveMap(apart.q_rad, apart.edges[~np.any(apart.edges == gap, axis=1)])
    assert len(np.unique(components(cut.n_neurons, cut.edges))) == 3
    joined = join_components(cut, motion_is_free, 0.15)
    assert len(np.unique(components(joined.n_neurons, joined.edges))) == 1
    assert all_free(joined)
    assert len(np.unique(components(cut.n_neurons, join_components(cut, motion_is_free, 0.05).edges))) == 3


@pytest.mark.parametrize("share_inside", [0.0, 0.01, 0.5, 0.99, 1.0])
def test_the_nearest_neuron_outside_is_that_of_brute_force(share_inside: float) -> None:
    rng = np.random.default_rng(4)
    q = rng.normal(size=(400, 3))
    inside = np.linalg.norm(q - q[0], axis=1) <= np.quantile(np.linalg.norm(q - q[0], axis=1), share_inside)
    distance, nearest = _nearest_outside(KDTree(q), q, inside, 0.6)
    for k, here in enumerate(np.flatnonzero(inside)):
        apart = np.where(inside, np.inf, np.linalg.norm(q - q[here], axis=1))
        if apart.min() < 0.6:
            assert nearest[k] == np.argmin(apart) and distance[k] == pytest.approx(apart.min())
        else:
            assert np.isinf(distance[k])


def test_the_largest_component_stays() -> None:
    two = CognitiveMap.of(np.arange(5.0)[:, None], np.array([[0, 1], [2, 3], [3, 4]]))
    np.testing.assert_array_equal(largest_component(two).q_rad.ravel(), [2, 3, 4])
    np.testing.assert_array_equal(largest_component(two).edges, [[0, 1], [1, 2]])


def test_filled_up_with_the_worst_represented_samples() -> None:
    whole = CognitiveMap.of(np.array([[0.0, 0.0], [0.1, 0.0]]), np.array([[0, 1]]))
    samples = np.array([[0.02, 0.0], [0.3, 0.0], [0.12, 0.0]])
    filled = fill_up(whole, samples, 3, motion_is_free, 2)
    np.testing.assert_array_equal(filled.q_rad[2], [0.3, 0.0])
    np.testing.assert_array_equal(filled.edges, [[0, 1], [0, 2], [1, 2]])


def test_samples_behind_the_wall_are_left_out() -> None:
    whole = CognitiveMap.of(np.array([[0.0, 0.0], [0.1, 0.0]]), np.array([[0, 1]]))
    filled = fill_up(whole, np.array([[0.9, 0.0], [0.2, 0.0]]), 4, motion_is_free, 2)
    np.testing.assert_array_equal(filled.q_rad[2:], [[0.2, 0.0]])


@pytest.mark.parametrize("n_neurons", [111, 150, 400])
def test_pruned_maps_have_one_free_component_and_the_wanted_size(n_neurons: int) -> None:
    rng = np.random.default_rng(0)
    samples = np.array([p for p in rng.uniform(size=(2500, 2)) if pose_is_free(p)])
    checks = {"pose_is_free": pose_is_free, "motion_is_free": motion_is_free}
    maps = [prune(lattice(), samples, n_neurons, **checks, bridge_max_rad=0.5, join_neighbours=4) for _ in range(2)]
    figures = statistics(maps[0], samples)
    assert (figures.neurons, figures.components) == (n_neurons, 1)
    assert all_free(maps[0])
    assert maps[0].q_rad.tobytes() == maps[1].q_rad.tobytes() and maps[0].edges.tobytes() == maps[1].edges.tobytes()


def test_a_lattice_loses_what_collides_and_gains_nothing() -> None:
    grown = lattice()
    kept, unit = prune_lattice(grown, pose_is_free=pose_is_free, motion_is_free=motion_is_free)
    assert all_free(kept)
    np.testing.assert_array_equal(kept.q_rad, grown.q_rad[unit])
    assert {tuple(unit[edge]) for edge in kept.edges} <= {tuple(edge) for edge in grown.edges}
    assert kept.n_neurons == 121 - 10  # the gap at y = 0.5 keeps both sides together
    assert statistics(kept, kept.q_rad).components == 1


def test_a_lattice_that_falls_apart_keeps_its_largest_part_and_is_not_mended() -> None:
    def is_free(q: np.ndarray) -> bool:
        return not 0.35 < q[0] < 0.45

    _, unit = prune_lattice(
        lattice(), pose_is_free=is_free, motion_is_free=lambda a, b: all(is_free(a + t * (b - a)) for t in np.linspace(0, 1, 50))
    )
    np.testing.assert_array_equal(unit, np.arange(5 * 11, 121))  # rows x = 0.5 to 1.0; those of x = 0 to 0.3 are fewer
    with pytest.raises(ValueError, match="121 units collide"):
        prune_lattice(lattice(), pose_is_free=lambda q: False, motion_is_free=motion_is_free)


def test_edges_of_a_map_are_checked_and_put_in_order() -> None:
    q = np.zeros((3, 2))
    np.testing.assert_array_equal(CognitiveMap.of(q, np.array([[2, 0], [0, 2], [1, 0]])).edges, [[0, 1], [0, 2]])
    for bad in ([[0, 3]], [[-1, 0]], [[1, 1]]):
        with pytest.raises(ValueError, match="edges"):
            CognitiveMap.of(q, np.array(bad))
