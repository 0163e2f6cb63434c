"""A map on its way to the fallback process, and there again."""

from __future__ import annotations

from functools import lru_cache

import msgspec
import numpy as np
from numpy.typing import NDArray

from services.planner.core.neuron_index import index_neurons
from services.planner.core.two_trees import Known
from services.planner.kernels.connect import Graph

__all__ = ["CarriedMap", "pack", "unpack"]

F64 = NDArray[np.float64]
KEPT = 2  # graphs; a map changes seldom, and an index takes longer than all the rest; our choice


class CarriedMap(msgspec.Struct, frozen=True):
    """Neurons (N, J) float64 rad, rows of neighbours as :class:`~services.planner.kernels.connect.Graph` has them, and what is blocked.

    All little-endian; ``blocked_nodes``, ``blocked_edges``: one bit each, the first in the highest place.
    """

    neurons_rad: bytes
    adj_offset: bytes  # int64
    adj_node: bytes  # int32
    adj_edge: bytes  # int32
    adj_length_rad: bytes  # float64
    blocked_nodes: bytes
    blocked_edges: bytes


def pack(known: Known) -> CarriedMap:
    """For the pipe."""
    graph = known.graph
    return CarriedMap(
        graph.neurons_rad.astype("<f8").tobytes(),
        graph.adj_offset.astype("<i8").tobytes(),
        graph.adj_node.astype("<i4").tobytes(),
        graph.adj_edge.astype("<i4").tobytes(),
        graph.adj_length.astype("<f8").tobytes(),
        np.packbits(known.node_count != 0).tobytes(),
        np.packbits(known.edge_count != 0).tobytes(),
    )


def unpack(carried: CarriedMap, n_joints: int) -> Known:
    """From the pipe; counts are 0 and 1."""
    graph = _graph(carried.neurons_rad, carried.adj_offset, carried.adj_node, carried.adj_edge, carried.adj_length_rad, n_joints)
    n, m = len(graph.neurons_rad), len(graph.adj_edge) // 2
    blocked = (np.frombuffer(bits, dtype=np.uint8) for bits in (carried.blocked_nodes, carried.blocked_edges))
    return Known(graph, *(np.unpackbits(bits, count=size).astype(np.int32) for bits, size in zip(blocked, (n, m), strict=True)))


@lru_cache(maxsize=KEPT)
def _graph(neurons: bytes, offset: bytes, node: bytes, edge: bytes, length: bytes, n_joints: int) -> Graph:
    neurons_rad: F64 = np.frombuffer(neurons, dtype="<f8").reshape(-1, n_joints).astype(np.float64)
    return Graph(
        neurons_rad,
        np.frombuffer(offset, dtype="<i8").astype(np.int64),
        np.frombuffer(node, dtype="<i4").astype(np.int32),
        np.frombuffer(edge, dtype="<i4").astype(np.int32),
        np.frombuffer(length, dtype="<f8").astype(np.float64),
        index_neurons(neurons_rad),
    )
