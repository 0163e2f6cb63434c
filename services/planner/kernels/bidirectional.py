"""Dijkstra from both ends at once: two balls that meet hold fewer neurons than one that reaches the goal.

Costs equal those of :func:`services.planner.kernels.search.best_first`. Source: Pohl, "Bi-directional search" (1971); that it may stop as
soon as the two smallest keys together reach the best way known: Goldberg et al., "Efficient point-to-point shortest path algorithms"
(2006). Twin: ``slow_dijkstra`` in ``tests/support/slow_planner.py``.
"""

from __future__ import annotations

import numpy as np

from common.kernel import kernel, leaf
from services.planner.kernels.search import NOT_FOUND, pop, push, surcharged

__all__ = ["both_ends"]


@kernel
def both_ends(  # type: ignore[no-untyped-def]
    adj_offset,
    adj_node,
    adj_edge,
    adj_length,
    node_count,
    edge_count,
    near,
    starts,
    start_cost,
    goals,
    goal_cost,
    cost,
    parent,
    heap_key,
    heap_node,
    path,
):
    """Shortest way from any of ``starts`` to any of ``goals``, grown from both; the side with the smaller key takes the next step.

    Arguments and return as :func:`services.planner.kernels.search.best_first`, but the scratch has a row for each side, the goals' in row
    1: cost, parent (2, N); heap_key, heap_node (2, at least the larger of S and G + 2 M + N).
    """
    cost[:] = np.inf
    parent[:] = -1
    size = np.zeros(2, dtype=np.int64)
    for side in range(2):
        ends, end_cost = (starts, start_cost) if side == 0 else (goals, goal_cost)
        for k in range(len(ends)):
            n = ends[k]
            if node_count[n] == 0 and end_cost[k] < cost[side, n]:
                cost[side, n] = end_cost[k]
                size[side] = push(heap_key[side], heap_node[side], size[side], end_cost[k], n)
    best, meeting = _meet(cost, starts)
    settled = 0
    while size[0] > 0 and size[1] > 0 and heap_key[0, 0] + heap_key[1, 0] < best:
        side = 0 if heap_key[0, 0] <= heap_key[1, 0] else 1
        key, n = heap_key[side, 0], heap_node[side, 0]
        size[side] = pop(heap_key[side], heap_node[side], size[side])
        if key > cost[side, n]:
            continue  # a cheaper way was found since
        settled += 1
        for i in range(adj_offset[n], adj_offset[n + 1]):
            m = adj_node[i]
            if node_count[m] > 0 or edge_count[adj_edge[i]] > 0 or key + adj_length[i] >= cost[side, m]:
                continue
            through = key + surcharged(adj_length[i], near, n, m, adj_edge[i])
            if through >= cost[side, m]:
                continue
            cost[side, m] = through
            parent[side, m] = n
            size[side] = push(heap_key[side], heap_node[side], size[side], through, m)
            if through + cost[1 - side, m] < best:
                best, meeting = through + cost[1 - side, m], m
    if meeting < 0:
        return NOT_FOUND, np.inf, settled
    return _trace_both(parent, meeting, path), best, settled


@leaf
def _meet(cost, starts):  # type: ignore[no-untyped-def]
    """The best neuron that both sides know before any step: one that start and goal join themselves; (its cost or infinity, it or -1)."""
    best, meeting = np.inf, -1
    for k in range(len(starts)):
        n = starts[k]
        if cost[0, n] + cost[1, n] < best:
            best, meeting = cost[0, n] + cost[1, n], n
    return best, meeting


@leaf
def _trace_both(parent, meeting, path):  # type: ignore[no-untyped-def]
    """Fill ``path`` from the start's root over ``meeting`` to the goal's root; returns its length."""
    n_before = 0
    n = parent[0, meeting]
    while n >= 0:
        n_before += 1
        n = parent[0, n]
    n, k = meeting, n_before
    while n >= 0:
        path[k] = n
        n = parent[0, n]
        k -= 1
    n, length = parent[1, meeting], n_before + 1
    while n >= 0:
        path[length] = n
        n = parent[1, n]
        length += 1
    return length
