"""From a grown gas to a map that can be driven: what collides goes, one component stays, and it has exactly the wanted number of neurons.

In this order, every step deterministic:

1. neurons that hit the static layer or the arm itself go, then edges whose straight motion does;
2. components are joined by the shortest free edges between them (at most ``bridge_max_rad``);
3. what still is apart from the largest component goes;
4. the neurons that are missing now are taken from the samples: each time the sample worst represented so far becomes a neuron, joined to
   its nearest neurons by free edges (the insertion rule of "growing when required", Marsland et al. 2002, with the samples themselves,
   which are known to be free, as places).

A lattice (SOM, gamma-SOM) keeps to its lattice: only what collides goes and what that cuts off, nothing is added. Measured at 100 x 100
units on the motions of the UR3: 38 units collide, 3 and 6 more are cut off, so neither bridges nor other places are missed.

No edge is too long: each is checked along its whole length and has its own row in the table. Some units of a lattice lie between two
bundles of motions and hold it together by edges of up to 2.5 rad; a limit would tear it there, while a long edge costs no more than being
blocked often (measured: tables of 59 MB for the SOM and 64 MB for the gamma-SOM against 57 MB for the gas, with twice as many edges).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from services.planner.core.cognitive_map import CognitiveMap, components

__all__ = ["fill_up", "in_largest_component", "join_components", "largest_component", "prune", "prune_lattice", "without_collisions"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
PoseCheck = Callable[[F64], bool]  # q (J,): free?
MotionCheck = Callable[[F64, F64], bool]  # from, to (J,): free?

BRIDGE_ATTEMPTS = 50  # our choice: pairs of neurons that are tried to join a component
FEW = 400  # neurons of a component whose nearest others are found in a tree of all; of more, a tree of the others is made; our choice


def prune(
    grown: CognitiveMap,
    samples_rad: F64,
    n_neurons: int,
    *,
    pose_is_free: PoseCheck,
    motion_is_free: MotionCheck,
    bridge_max_rad: float,
    join_neighbours: int,
) -> CognitiveMap:
    """The map of ``n_neurons`` in one component as the module says; fewer neurons only if no sample can be joined any more."""
    free = without_collisions(grown, pose_is_free, motion_is_free)
    joined = join_components(free, motion_is_free, bridge_max_rad)
    whole = largest_component(joined)
    return fill_up(whole, samples_rad, n_neurons, motion_is_free, join_neighbours)


def prune_lattice(grown: CognitiveMap, *, pose_is_free: PoseCheck, motion_is_free: MotionCheck) -> tuple[CognitiveMap, I32]:
    """What is free and in one component, and (N,) int32 ascending which units of ``grown`` these are.

    Raises:
        ValueError: every unit collides.
    """
    is_free = _free_poses(grown, pose_is_free)
    if not is_free.any():
        raise ValueError(f"all {grown.n_neurons} units collide: nothing is left of the lattice")
    free = _with_free_edges(grown.subset(is_free), motion_is_free)
    is_whole = in_largest_component(free)
    return free.subset(is_whole), np.flatnonzero(is_free)[is_whole].astype(np.int32)


def without_collisions(grown: CognitiveMap, pose_is_free: PoseCheck, motion_is_free: MotionCheck) -> CognitiveMap:
    """The neurons that are free, and the edges between them whose straight motion is."""
    return _with_free_edges(grown.subset(_free_poses(grown, pose_is_free)), motion_is_free)


def _free_poses(grown: CognitiveMap, pose_is_free: PoseCheck) -> NDArray[np.bool_]:
    return np.array([pose_is_free(q) for q in grown.q_rad], dtype=np.bool_)


def _with_free_edges(kept: CognitiveMap, motion_is_free: MotionCheck) -> CognitiveMap:
    free = np.array([motion_is_free(kept.q_rad[a], kept.q_rad[b]) for a, b in kept.edges], dtype=np.bool_)
    return CognitiveMap(kept.q_rad, kept.edges[free])


def join_components(apart: CognitiveMap, motion_is_free: MotionCheck, bridge_max_rad: float) -> CognitiveMap:
    """Bridges of free edges, shortest first, from each component to any other, until none is left that can be joined."""
    edges, tree = apart.edges, KDTree(apart.q_rad)
    while True:
        labels = components(apart.n_neurons, edges)
        apart_ones = np.argsort(-np.bincount(labels), kind="stable")[1:]  # all but the largest
        bridges = [_bridge(tree, apart.q_rad, labels == c, motion_is_free, bridge_max_rad) for c in apart_ones]
        found = [bridge for bridge in bridges if bridge is not None]
        if not found:
            return CognitiveMap.of(apart.q_rad, edges)
        edges = CognitiveMap.of(apart.q_rad, np.vstack([edges, found])).edges


def _bridge(
    tree: KDTree, q_rad: F64, inside: NDArray[np.bool_], motion_is_free: MotionCheck, bridge_max_rad: float
) -> tuple[int, int] | None:
    here = np.flatnonzero(inside)
    distance, nearest = _nearest_outside(tree, q_rad, inside, bridge_max_rad)
    for k in np.argsort(distance, kind="stable")[:BRIDGE_ATTEMPTS]:
        if not np.isfinite(distance[k]):
            break
        a, b = int(here[k]), int(nearest[k])
        if motion_is_free(q_rad[a], q_rad[b]):
            return a, b
    return None


def _nearest_outside(tree: KDTree, q_rad: F64, inside: NDArray[np.bool_], most_rad: float) -> tuple[F64, NDArray[np.intp]]:
    """For each neuron that is ``inside``, in order, the nearest one that is not, and its distance; infinite beyond ``most_rad``.

    ``tree`` has all neurons: of a few inside, one more than they are has one that is outside among its nearest.
    """
    here, there = np.flatnonzero(inside), np.flatnonzero(~inside)
    if len(there) == 0 or len(here) > FEW:
        distance, which = KDTree(q_rad[there]).query(q_rad[here], distance_upper_bound=most_rad)
        return distance, np.append(there, -1)[which]
    distances, who = tree.query(q_rad[here], k=np.arange(1, len(here) + 2), distance_upper_bound=most_rad)
    is_inside = np.append(inside, False)[who]  # who is the number of all neurons, and infinitely far, where there is none
    first = np.argmin(is_inside, axis=1)
    row = np.arange(len(here))
    return distances[row, first], who[row, first]


def largest_component(joined: CognitiveMap) -> CognitiveMap:
    """The largest component alone."""
    return joined.subset(in_largest_component(joined))


def in_largest_component(joined: CognitiveMap) -> NDArray[np.bool_]:
    """(N,) which neurons are in the largest component; of equals the one with the lowest neuron."""
    labels = components(joined.n_neurons, joined.edges)
    return np.asarray(labels == np.argmax(np.bincount(labels)))


def fill_up(whole: CognitiveMap, samples_rad: F64, n_neurons: int, motion_is_free: MotionCheck, join_neighbours: int) -> CognitiveMap:
    """``whole`` with neurons added at the worst represented samples, each joined by free edges, until there are ``n_neurons``."""
    n = whole.n_neurons
    q = np.empty((max(n, n_neurons), samples_rad.shape[1]))
    q[:n] = whole.q_rad
    edges = [whole.edges.astype(np.int64)]
    distance, _ = KDTree(whole.q_rad).query(samples_rad)
    samples = KDTree(samples_rad)
    while n < n_neurons and distance.max() > 0.0:
        worst = int(np.argmax(distance))
        sample = samples_rad[worst]
        free = [k for k in _nearest(q[:n], sample, join_neighbours) if motion_is_free(q[k], sample)]
        if not free:
            distance[worst] = 0.0  # cannot be joined from here: left out
            continue
        q[n] = sample
        edges.append(np.array([(k, n) for k in free], dtype=np.int64))
        nearer = samples.query_ball_point(sample, distance[worst])  # no sample was farther from the map than this one
        distance[nearer] = np.minimum(distance[nearer], np.linalg.norm(samples_rad[nearer] - sample, axis=1))
        n += 1
    return CognitiveMap.of(q[:n], np.vstack(edges))


def _nearest(q_rad: F64, q: F64, n: int) -> list[int]:
    """The ``n`` nearest to ``q`` (J,), nearest first, of equals the lower index."""
    distance = np.linalg.norm(q_rad - q, axis=1)
    near = np.flatnonzero(distance <= np.partition(distance, min(n, len(distance)) - 1)[min(n, len(distance)) - 1])
    return [int(k) for k in near[np.argsort(distance[near], kind="stable")[:n]]]
