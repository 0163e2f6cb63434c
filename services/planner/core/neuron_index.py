"""Builds the index by which the nearest neurons are found."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from services.planner.core.cognitive_map import CognitiveMap
from services.planner.kernels.neuron_index import BUCKET, NeuronIndex

__all__ = ["in_order_of_place", "index_neurons"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]


def index_neurons(q_rad: F64) -> NeuronIndex:
    """The index of neurons (N, J), possibly none: halved at the median of the joint of widest spread, until leaves are small."""
    depth = max(0, math.ceil(math.log2(max(1, len(q_rad)) / BUCKET)))
    n_nodes = 2 ** (depth + 1) - 1
    low, high = np.empty((n_nodes, q_rad.shape[1])), np.empty((n_nodes, q_rad.shape[1]))
    parts: list[I32] = [np.arange(len(q_rad), dtype=np.int32)]
    node = 0
    for level in range(depth + 1):
        halves: list[I32] = []
        for members in parts:
            low[node], high[node] = _box(q_rad[members])
            if level < depth:
                joint = int(np.argmax(high[node] - low[node])) if len(members) else 0
                order = members[np.argsort(q_rad[members, joint], kind="stable")]
                halves += [order[: len(order) // 2], order[len(order) // 2 :]]
            node += 1
        parts = halves if level < depth else parts
    neuron = np.concatenate(parts)
    offset = np.concatenate([[0], np.cumsum([len(part) for part in parts])]).astype(np.int32)
    return NeuronIndex(np.ascontiguousarray(q_rad[neuron]), neuron, offset, low, high)


def in_order_of_place(learned: CognitiveMap) -> CognitiveMap:
    """The map with its neurons numbered as the index has them, so that near ones lie together in memory.

    Growth and pruning number them by the time at which they came. A search goes from neuron to neuron, and a cell blocks neurons that are
    near each other. Measured (search alone): 0.8 of the time at 10 000 neurons, 0.6 at 100 000.
    """
    return learned.renumbered(index_neurons(learned.q_rad).neuron)


def _box(q_rad: F64) -> tuple[F64, F64]:
    """Lowest and highest corner (J,); of nothing: a box that is infinitely far away."""
    return q_rad.min(axis=0, initial=np.inf), q_rad.max(axis=0, initial=-np.inf)
