"""Which pairs of neurons an edge would bring much nearer together: useful cycles (Nieuwenhuisen and Overmars 2004).

A pair's edge is useful where the shortest way over the edges so far is longer than ``stretch`` times the straight line. Asked shortest
pair first, with each useful edge taken in at once. Twin: ``tests/support/slow_cycles.py``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from common.kernel import leaf
from services.planner.kernels.search import pop, push

__all__ = ["Growing", "add_edge", "growing", "next_useful"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


class Growing(NamedTuple):
    """A graph of N neurons that edges are added to, with room for E edges; rows of neighbours are linked lists. And a search's scratch."""

    head: I64  # (N,) first link of a neuron, or -1
    after: I64  # (2 E,) next link of the same neuron, or -1
    to: I64  # (2 E,) the neighbour
    length: F64  # (2 E,) rad
    n_links: I64  # (1,)
    cost: F64  # (N,)
    asked: I64  # (N,) which pair ``cost`` is of
    heap_key: F64  # (2 E + 1,)
    heap_node: I64


def growing(n_neurons: int, n_edges: int) -> Growing:
    """A graph without edges, with room for ``n_edges``."""
    links = 2 * n_edges
    return Growing(
        np.full(n_neurons, -1), np.empty(links, dtype=np.int64), np.empty(links, dtype=np.int64), np.empty(links),
        np.zeros(1, dtype=np.int64), np.empty(n_neurons), np.full(n_neurons, -1), np.empty(links + 1), np.empty(links + 1, dtype=np.int64),
    )  # fmt: skip


@leaf
def add_edge(graph, a, b, length):  # type: ignore[no-untyped-def]
    """Join neurons ``a`` and ``b``; there must be room."""
    for here, there in ((a, b), (b, a)):
        link = graph.n_links[0]
        graph.to[link], graph.length[link], graph.after[link] = there, length, graph.head[here]
        graph.head[here] = link
        graph.n_links[0] = link + 1


@leaf
def _is_within(graph, pair, a, b, bound):  # type: ignore[no-untyped-def]
    """Whether a way from ``a`` to ``b`` is no longer than ``bound``; ``pair`` tells this search's marks from earlier ones'."""
    size = push(graph.heap_key, graph.heap_node, 0, 0.0, a)
    graph.cost[a], graph.asked[a] = 0.0, pair
    while size > 0:
        cost, n = graph.heap_key[0], graph.heap_node[0]
        if n == b:
            return True
        size = pop(graph.heap_key, graph.heap_node, size)
        if cost > graph.cost[n]:
            continue
        link = graph.head[n]
        while link >= 0:
            m, through = graph.to[link], cost + graph.length[link]
            if through <= bound and (graph.asked[m] != pair or through < graph.cost[m]):
                graph.cost[m], graph.asked[m] = through, pair
                size = push(graph.heap_key, graph.heap_node, size, through, m)
            link = graph.after[link]
    return False


@leaf
def next_useful(graph, pairs, length, first, stretch):  # type: ignore[no-untyped-def]
    """The first of the pairs (C, 2) from ``first`` on, ``length`` (C,) rad apart, whose edge would be useful; C if none is.

    To be called with ascending ``first``: a pair is asked once.
    """
    for k in range(first, len(pairs)):
        if not _is_within(graph, k, pairs[k, 0], pairs[k, 1], stretch * length[k]):
            return k
    return len(pairs)
