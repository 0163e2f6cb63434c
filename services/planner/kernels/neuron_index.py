"""The neurons in a balanced k-d tree of buckets (Bentley 1975, with bounding boxes): which are the nearest, without a look at all.

Twin: sorting all of them (``tests/unit/planner/test_neuron_index.py``).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from common.kernel import kernel, leaf

__all__ = ["BUCKET", "NeuronIndex", "nearest_free"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
BUCKET = 16  # neurons of a leaf at most; our choice
MAX_DEPTH = 40


class NeuronIndex(NamedTuple):
    """N neurons in a perfect binary tree of 2^D leaves: node i has the children 2 i + 1 and 2 i + 2."""

    q_rad: F64  # (N, J) the neurons leaf by leaf
    neuron: I32  # (N,) which neuron each of these is
    leaf_offset: I32  # (2^D + 1,)
    low_rad: F64  # (2^(D+1) - 1, J) bounding box of each node
    high_rad: F64


@leaf
def _to_box(tree, node, q):  # type: ignore[no-untyped-def]
    """Squared distance of ``q`` to the box of a node."""
    total = 0.0
    for j in range(len(q)):
        d = max(tree.low_rad[node, j] - q[j], q[j] - tree.high_rad[node, j], 0.0)
        total += d * d
    return total


@kernel
def nearest_free(tree, node_count, q, index, distance):  # type: ignore[no-untyped-def]
    """The ``len(index)`` nearest neurons of ``q`` (J,) whose ``node_count`` (N,) is zero, nearest first; equal distances by number.

    Fills ``index`` and ``distance`` (rad); returns how many were found.
    """
    return _nearest_free(tree, node_count, q, index, distance, np.empty(MAX_DEPTH, dtype=np.int64), np.empty(MAX_DEPTH))


@leaf
def _nearest_free(tree, node_count, q, index, distance, waiting, apart):  # type: ignore[no-untyped-def]
    """:func:`nearest_free`; ``waiting``, ``apart`` (MAX_DEPTH,): scratch, nodes to look into and their squared distances."""
    k, found, n_waiting = len(index), 0, 1
    waiting[0], apart[0] = 0, 0.0
    first_leaf = len(tree.leaf_offset) - 2
    while n_waiting > 0:
        n_waiting -= 1
        node = waiting[n_waiting]
        if found == k and apart[n_waiting] > distance[k - 1]:
            continue
        if node >= first_leaf:
            found = _search_leaf(tree, node - first_leaf, node_count, q, index, distance, found)
            continue
        left, right = 2 * node + 1, 2 * node + 2
        to_left, to_right = _to_box(tree, left, q), _to_box(tree, right, q)
        if to_left < to_right:  # the nearer one is looked at first: it comes last onto the stack
            left, right, to_left, to_right = right, left, to_right, to_left
        waiting[n_waiting], apart[n_waiting] = left, to_left
        waiting[n_waiting + 1], apart[n_waiting + 1] = right, to_right
        n_waiting += 2
    for i in range(found):
        distance[i] = math.sqrt(distance[i])
    return found


@leaf
def _search_leaf(tree, leaf, node_count, q, index, distance, found):  # type: ignore[no-untyped-def]
    """Put the unblocked neurons of a leaf that are among the nearest where they belong; ``distance`` is squared here."""
    k = len(index)
    for i in range(tree.leaf_offset[leaf], tree.leaf_offset[leaf + 1]):
        n = tree.neuron[i]
        if node_count[n] > 0:
            continue
        d2 = 0.0
        for j in range(len(q)):
            d2 += (tree.q_rad[i, j] - q[j]) ** 2
        if found == k and (d2 > distance[k - 1] or (d2 == distance[k - 1] and n > index[k - 1])):
            continue
        place = min(found, k - 1)
        while place > 0 and (distance[place - 1] > d2 or (distance[place - 1] == d2 and index[place - 1] > n)):
            distance[place], index[place] = distance[place - 1], index[place - 1]
            place -= 1
        distance[place], index[place] = d2, n
        found = min(found + 1, k)
    return found
