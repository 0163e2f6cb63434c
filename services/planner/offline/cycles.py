"""More edges where the learned ones make a long way round: useful cycles (Nieuwenhuisen and Overmars 2004, ICRA).

A gas joins what its samples pass one after the other, so two motions side by side are joined only where they meet. Measured on the UR3's
gas (10 000 neurons, 19 484 edges; 500 task and 500 off_task questions, the map alone, ways as the search found them; without: 427 and 329
solved, a table of 53 MB, 4.3 s for that of an arm with a new box), about 30 neighbours:

* stretch 4: 1 713 more edges, 429 and 334 solved, ways 0.4 and 3.3 % shorter, 55 MB, 4.3 s;
* stretch 3: 4 103 more edges, 428 and 334 solved, ways 2.5 and 4.2 % shorter, 58 MB, 5.2 s;
* stretch 2: 15 306 more edges, 430 and 335 solved, ways 3.7 and 5.8 % shorter, 70 MB, 8.5 s;
* stretch 1.5, 60 neighbours: 64 082 more edges, 432 and 340 solved, ways 8 % shorter, 142 MB, the search half slower.

The first is the default: an arm waits for the table of what it has grasped, at most 5 s. With the others the search is
no slower than without, but for the last.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from services.planner.core.cognitive_map import CognitiveMap
from services.planner.kernels.cycles import add_edge, growing, next_useful

__all__ = ["with_useful_cycles"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


def with_useful_cycles(
    learned: CognitiveMap, motion_is_free: Callable[[F64, F64], bool], stretch: float, n_neighbours: int
) -> CognitiveMap:
    """The map with an edge between each two near neurons whose way over the map is longer than ``stretch`` straight lines.

    Args:
        learned: the map.
        motion_is_free: whether the straight motion between two (J,) is; an edge that is not is left out.
        stretch: at least 1; fewer edges the larger it is.
        n_neighbours: nearest neurons of each that are asked. Shortest pairs first, of equals the lower neurons: deterministic.
    """
    pairs, length = _near_pairs(learned.q_rad, n_neighbours)
    q, n_edges = learned.q_rad, len(learned.edges) + len(pairs)
    graph = growing(learned.n_neurons, n_edges)
    for (a, b), edge_rad in zip(learned.edges.tolist(), learned.edge_length_rad.tolist(), strict=True):
        add_edge(graph, a, b, edge_rad)
    more: list[I64] = []
    at = -1
    while (at := int(next_useful(graph, pairs, length, at + 1, stretch))) < len(pairs):
        a, b = pairs[at]
        if motion_is_free(q[a], q[b]):
            add_edge(graph, a, b, length[at])
            more.append(pairs[at])
    return CognitiveMap.of(q, np.vstack([learned.edges, *more]))


def _near_pairs(q_rad: F64, n_neighbours: int) -> tuple[I64, F64]:
    """(C, 2) each pair of neurons of which one is among the other's nearest, once, lower neuron first; (C,) rad apart, ascending."""
    n = len(q_rad)
    k = min(n_neighbours + 1, n)
    _, nearest = KDTree(q_rad).query(q_rad, k=np.arange(1, k + 1))
    pairs = np.stack([np.repeat(np.arange(n), k), nearest.ravel()], axis=1).astype(np.int64)
    pairs = np.unique(np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1), axis=0)
    length = np.asarray(np.linalg.norm(q_rad[pairs[:, 0]] - q_rad[pairs[:, 1]], axis=1))
    order = np.argsort(length, kind="stable")
    return np.ascontiguousarray(pairs[order]), length[order]
