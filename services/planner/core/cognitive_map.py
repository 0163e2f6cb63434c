"""The cognitive map: joint configurations (neurons) and learned neighbourhoods (edges), and what can be said about it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

__all__ = ["CognitiveMap", "MapStatistics", "components", "n_components", "quantisation_error_rad", "statistics", "topographic_error"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class CognitiveMap:
    """Neurons ``q_rad`` (N, J) and undirected edges (M, 2) int32, each once with the lower neuron first, rows ascending.

    This shape is common to all models: growing neural gas, SOM, gamma-SOM.
    """

    q_rad: F64
    edges: I32

    @staticmethod
    def of(q_rad: F64, edges: NDArray[np.integer]) -> CognitiveMap:
        """A map of edges in any order and direction; doubles are dropped.

        Raises:
            ValueError: an edge names a neuron that is not there or joins one with itself.
        """
        pairs = np.sort(np.asarray(edges, dtype=np.int64).reshape(-1, 2), axis=1)
        if len(pairs) and (pairs.min() < 0 or pairs.max() >= len(q_rad) or np.any(pairs[:, 0] == pairs[:, 1])):
            raise ValueError(f"edges must join two different neurons of 0..{len(q_rad) - 1}")
        pairs = np.unique(pairs, axis=0)
        return CognitiveMap(np.ascontiguousarray(q_rad, dtype=np.float64), np.ascontiguousarray(pairs, dtype=np.int32))

    @property
    def n_neurons(self) -> int:
        """Number of neurons."""
        return len(self.q_rad)

    @property
    def edge_length_rad(self) -> F64:
        """(M,) Euclidean joint distances of the edges' ends."""
        return np.asarray(np.linalg.norm(self.q_rad[self.edges[:, 0]] - self.q_rad[self.edges[:, 1]], axis=1))

    def subset(self, keep: NDArray[np.bool_]) -> CognitiveMap:
        """The map of the neurons where ``keep`` (N,) is set, in the same order, with the edges between them."""
        number = np.cumsum(keep) - 1
        edges = self.edges[keep[self.edges].all(axis=1)]
        return CognitiveMap(self.q_rad[keep], number[edges].astype(np.int32).reshape(-1, 2))

    def renumbered(self, order: NDArray[np.integer]) -> CognitiveMap:
        """The same map with the neuron ``order[k]`` as number k; ``order`` (N,) is a permutation."""
        number = np.empty(self.n_neurons, dtype=np.int64)
        number[order] = np.arange(self.n_neurons)
        return CognitiveMap.of(self.q_rad[order], number[self.edges])

    def best_match(self, q_rad: F64) -> I32:
        """Index of the nearest neuron for each of (K, J) configurations; ties go to the lower index."""
        q = np.atleast_2d(np.asarray(q_rad, dtype=np.float64))
        best = np.empty(len(q), dtype=np.int32)
        for start in range(0, len(q), 256):  # 256 x 10 000 x 6 float64: 120 MB at most
            block = q[start : start + 256, None, :] - self.q_rad[None]
            best[start : start + 256] = np.argmin(np.einsum("knj,knj->kn", block, block), axis=1)
        return best


def components(n_neurons: int, edges: NDArray[np.integer]) -> I32:
    """Component label of each neuron; labels are handed out in the order of the lowest neuron."""
    graph = coo_array((np.ones(len(edges), dtype=np.int8), (edges[:, 0], edges[:, 1])), shape=(n_neurons, n_neurons))
    _, labels = connected_components(graph, directed=False)
    _, first = np.unique(labels, return_index=True)
    rank = np.empty(len(first), dtype=np.int32)
    rank[np.argsort(first)] = np.arange(len(first), dtype=np.int32)
    return np.asarray(rank[labels], dtype=np.int32)


def n_components(cognitive_map: CognitiveMap) -> int:
    """How many parts a map has that no edge joins."""
    return int(components(cognitive_map.n_neurons, cognitive_map.edges).max(initial=-1)) + 1


def quantisation_error_rad(cognitive_map: CognitiveMap, samples_rad: F64) -> float:
    """Mean distance of ``samples_rad`` (S, J) to their best match (Kohonen)."""
    distance, _ = KDTree(cognitive_map.q_rad).query(samples_rad)
    return float(np.mean(distance))


def topographic_error(cognitive_map: CognitiveMap, samples_rad: F64) -> float:
    """Share of ``samples_rad`` (S, J) whose two nearest neurons no edge joins (Kiviluoto 1996); 0 where edges follow the samples."""
    _, nearest = KDTree(cognitive_map.q_rad).query(samples_rad, k=2)
    pairs = np.sort(nearest, axis=1).astype(np.int64)
    n = cognitive_map.n_neurons
    joined = np.isin(pairs[:, 0] * n + pairs[:, 1], cognitive_map.edges[:, 0].astype(np.int64) * n + cognitive_map.edges[:, 1])
    return float(1.0 - np.mean(joined))


@dataclass(frozen=True)
class MapStatistics:
    """Figures of a map; lengths in rad of joint space, quantiles as 0 %, 5 %, 50 %, 95 %, 100 %."""

    neurons: int
    edges: int
    components: int
    quantisation_error_rad: float
    degree_mean: float
    degree_quantiles: list[float]
    edge_length_mean_rad: float
    edge_length_quantiles_rad: list[float]


def statistics(cognitive_map: CognitiveMap, samples_rad: F64) -> MapStatistics:
    """Mean distance of ``samples_rad`` (S, J) to their best match, components, degrees and edge lengths of a map with edges."""
    n = cognitive_map.n_neurons
    degree = np.bincount(cognitive_map.edges.ravel(), minlength=n)
    length = cognitive_map.edge_length_rad
    quantiles = [0.0, 0.05, 0.5, 0.95, 1.0]
    return MapStatistics(
        neurons=n,
        edges=len(length),
        components=n_components(cognitive_map),
        quantisation_error_rad=quantisation_error_rad(cognitive_map, samples_rad),
        degree_mean=float(np.mean(degree)),
        degree_quantiles=[float(v) for v in np.quantile(degree, quantiles)],
        edge_length_mean_rad=float(np.mean(length)),
        edge_length_quantiles_rad=[float(v) for v in np.quantile(length, quantiles)],
    )
