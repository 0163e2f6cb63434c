"""A cognitive map as a graph for the search kernels: adjacency in rows, lengths, scratch."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from common.geometry.grid import Grid
from services.planner.core.cognitive_map import CognitiveMap
from services.planner.core.lookup import BlockedCounts, LookupTable
from services.planner.core.neuron_index import index_neurons
from services.planner.kernels.connect import Graph
from services.planner.kernels.neuron_index import NeuronIndex

__all__ = ["Roadmap", "edge_between"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]


def edge_between(graph: Graph, a: int, b: int) -> int:
    """Index of the edge between two neurons.

    Raises:
        KeyError: there is none.
    """
    row = slice(graph.adj_offset[a], graph.adj_offset[a + 1])
    found = np.flatnonzero(graph.adj_node[row] == b)
    if len(found) == 0:
        raise KeyError(f"no edge between neurons {a} and {b}")
    return int(graph.adj_edge[row][found[0]])


@dataclass(frozen=True, eq=False)
class Roadmap:
    """Neurons, edges and table of one map, immutable.

    Attributes:
        neurons_rad: (N, J). edges: (M, 2) int32, lower neuron first.
        adj_offset: (N + 1,) rows of neighbours; adj_node, adj_edge (2 M,) neighbour and edge index; adj_length (2 M,) rad.
        index: by which the nearest neurons are found.
        table: which cells block what.
        model: name of the model that learned it (``gng``, ``som``, ``gamma_som``).
        n_built, n_built_edges: how many neurons and edges the map was built with; those behind them were learned since, and are asked only
            where the others have no way, so that learning spoils no answer that there was.
    """

    neurons_rad: F64
    edges: I32
    adj_offset: I64
    adj_node: I32
    adj_edge: I32
    adj_length: F64
    index: NeuronIndex
    table: LookupTable
    model: str
    n_built: int
    n_built_edges: int

    @cached_property
    def graph(self) -> Graph:
        """The map as the searches see it."""
        return Graph(self.neurons_rad, self.adj_offset, self.adj_node, self.adj_edge, self.adj_length, self.index)

    @staticmethod
    def of(learned: CognitiveMap, table: LookupTable, model: str, built: tuple[int, int] | None = None) -> Roadmap:
        """The graph of a map and its table; ``built``: neurons and edges that it was built with, if not all."""
        n, m = learned.n_neurons, len(learned.edges)
        ends = np.concatenate([learned.edges, learned.edges[:, ::-1]])
        edge = np.concatenate([np.arange(m), np.arange(m)]).astype(np.int32)
        order = np.lexsort((ends[:, 1], ends[:, 0]))
        offset = np.concatenate([[0], np.cumsum(np.bincount(ends[:, 0], minlength=n))]).astype(np.int64)
        length = learned.edge_length_rad
        return Roadmap(
            neurons_rad=np.ascontiguousarray(learned.q_rad),
            edges=learned.edges,
            adj_offset=offset,
            adj_node=np.ascontiguousarray(ends[order, 1], dtype=np.int32),
            adj_edge=edge[order],
            adj_length=length[edge[order]],
            index=index_neurons(np.ascontiguousarray(learned.q_rad)),
            table=table,
            model=model,
            n_built=n if built is None else built[0],
            n_built_edges=m if built is None else built[1],
        )

    def counts(self, grid: Grid) -> BlockedCounts:
        """What is blocked in a world of this grid; empty as yet."""
        return BlockedCounts(self.table, self.n_neurons, self.n_edges, grid.shape)

    def edge_between(self, a: int, b: int) -> int:
        """Index of the edge between two neurons.

        Raises:
            KeyError: there is none.
        """
        return edge_between(self.graph, a, b)

    @property
    def has_learned(self) -> bool:
        """Whether there is more than it was built with."""
        return self.n_built < self.n_neurons or self.n_built_edges < self.n_edges

    @property
    def n_neurons(self) -> int:
        """Number of neurons."""
        return len(self.neurons_rad)

    @property
    def n_edges(self) -> int:
        """Number of edges."""
        return len(self.edges)
