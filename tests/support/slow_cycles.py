"""Useful cycles pair by pair, each way measured by Dijkstra on the whole graph: the twin of services.planner.kernels.cycles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

F64 = NDArray[np.float64]


def slow_cycles(
    q_rad: F64, edges: NDArray[np.integer], is_free: Callable[[F64, F64], bool], stretch: float, k: int
) -> set[tuple[int, int]]:
    """All edges, with those that are useful."""
    n = len(q_rad)
    apart = np.linalg.norm(q_rad[:, None] - q_rad[None], axis=2)
    near = {(min(a, int(b)), max(a, int(b))) for a in range(n) for b in np.argsort(apart[a], kind="stable")[1 : k + 1]}
    joined = {(int(a), int(b)) for a, b in edges}
    for a, b in sorted(near, key=lambda pair: (apart[pair], pair)):
        rows = np.array(sorted(joined))
        graph = coo_array((apart[rows[:, 0], rows[:, 1]], (rows[:, 0], rows[:, 1])), shape=(n, n))
        way = dijkstra(graph.tocsr(), directed=False, indices=a)[b]
        if way > stretch * apart[a, b] and is_free(q_rad[a], q_rad[b]):
            joined.add((a, b))
    return joined
