"""Graph search on the unblocked part of the map: Dijkstra, A* and wavefront, from many starts to many goals.

A neuron is blocked while its count is above zero, an edge while its own is. Ties are broken by the order in the queue, which depends on
the input alone: equal questions get equal answers. Dijkstra from both ends: :mod:`services.planner.kernels.bidirectional`. Twins:
``tests/support/slow_planner.py``.
"""

from __future__ import annotations

import numpy as np

from common.kernel import leaf
from services.planner.kernels.buckets import BUCKET_RAD, N_BUCKETS, arrange, bound_of, next_bucket, put, take
from services.planner.kernels.prefetch import prefetch

__all__ = ["NOT_FOUND", "best_first", "breadth_first", "pop", "push", "surcharged"]

NOT_FOUND = -1
MARK_BITS, MARK_MASK = 6, 63


@leaf
def push(heap_key, heap_node, size, key, node):  # type: ignore[no-untyped-def]
    """Put ``node`` under ``key`` into a heap of ``size`` elements, the smallest key at the root; returns the new size."""
    i = size
    while i > 0:
        parent = (i - 1) >> 1
        if heap_key[parent] <= key:
            break
        heap_key[i], heap_node[i] = heap_key[parent], heap_node[parent]
        i = parent
    heap_key[i], heap_node[i] = key, node
    return size + 1


@leaf
def pop(heap_key, heap_node, size):  # type: ignore[no-untyped-def]
    """Remove the root (its values were read before); the last element sinks from the top."""
    size -= 1
    key, node = heap_key[size], heap_node[size]
    i = 0
    while True:
        child = 2 * i + 1
        if child >= size:
            break
        if child + 1 < size and heap_key[child + 1] < heap_key[child]:
            child += 1
        if heap_key[child] >= key:
            break
        heap_key[i], heap_node[i] = heap_key[child], heap_node[child]
        i = child
    heap_key[i], heap_node[i] = key, node
    return size


@leaf
def surcharged(length, near, n, m, edge):  # type: ignore[no-untyped-def]
    """Cost of an edge of ``length`` between neurons ``n`` and ``m``: more in the band of the nearest thing to any of the three.

    ``near``: :class:`services.planner.core.near.Near`. Never less than the length, so A*'s bound stays admissible.
    """
    if len(near.factor) == 0:
        return length
    return length * near.factor[min(near.node[n], near.node[m], near.edge[edge])]


@leaf
def best_first(  # type: ignore[no-untyped-def]
    neurons,
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
    q_goal,
    use_bound,
    cost,
    parent,
    entry_cost,
    queue,
    path,
):
    """Shortest way from any of ``starts`` to any of ``goals``; Dijkstra, or A* with ``use_bound``.

    Args:
        neurons: (N, J) for A*'s bound, the straight distance to ``q_goal`` (J,): admissible, since edges are at least that long.
        adj_offset, adj_node, adj_edge, adj_length: adjacency in rows.
        node_count, edge_count: blocked while above zero.
        near: what is near neurons and edges, and what that costs (:func:`surcharged`).
        starts, start_cost: (S,) neurons joined to the start, and the length of that join; likewise goals. Infinite cost: not to be used.
        cost, parent: (N,) scratch. entry_cost, queue: scratch as in :mod:`services.planner.kernels.buckets`, at least
            S + N and the most neighbours of a neuron entries long.
        path: (N,) int32 out: neurons from start to goal.

    Returns:
        (number of neurons on the path or ``NOT_FOUND``, total cost, number of times that a neuron was settled).
    """
    q_bound = q_goal if use_bound else q_goal[:0]
    cost[:] = np.inf
    n_entries = _begin(node_count, starts, start_cost, cost, parent, entry_cost, queue)
    low, n_entries = arrange(queue, entry_cost, n_entries, cost, neurons, q_bound)
    few, fewer = _marks(goals, 0), _marks(goals, MARK_BITS)
    at, settled, best, best_end = 0, 0, np.inf, -1
    while n_entries > 0:
        at = next_bucket(queue, at)
        if low + at * BUCKET_RAD >= best:
            break
        if at == N_BUCKETS:
            low, n_entries = arrange(queue, entry_cost, n_entries, cost, neurons, q_bound)
            at = 0
            continue
        n = take(queue, entry_cost, cost, at)
        if n < 0:
            continue
        settled += 1
        here = cost[n]
        _fetch_neighbours(n, neurons, adj_offset, adj_node, adj_edge, node_count, edge_count, near, cost)
        _fetch_next(queue, at, adj_offset, adj_node, adj_edge, adj_length)
        if (few >> (n & MARK_MASK)) & (fewer >> ((n >> MARK_BITS) & MARK_MASK)) & 1:
            end = here + _join_cost(n, goals, goal_cost)
            if end < best:
                best, best_end = end, n
        if n_entries + adj_offset[n + 1] - adj_offset[n] > len(entry_cost):
            low, n_entries = arrange(queue, entry_cost, n_entries, cost, neurons, q_bound)
            at = 0
        for i in range(adj_offset[n], adj_offset[n + 1]):
            m = adj_node[i]
            if here + adj_length[i] >= cost[m] or node_count[m] > 0 or edge_count[adj_edge[i]] > 0:
                continue
            through = here + surcharged(adj_length[i], near, n, m, adj_edge[i])
            if through >= cost[m]:
                continue
            cost[m] = through
            parent[m] = n
            key = through + bound_of(neurons, m, q_bound)
            if key < best:
                put(queue, entry_cost, n_entries, m, through, key, low, at)
                n_entries += 1
    if best_end < 0:
        return NOT_FOUND, np.inf, settled
    return _trace(parent, best_end, path), best, settled


@leaf
def _fetch_neighbours(n, neurons, adj_offset, adj_node, adj_edge, node_count, edge_count, near, cost):  # type: ignore[no-untyped-def]
    """Ask for all that will be read of the neighbours of ``n``, so that the waits for it run side by side.

    Measured at 100 000 neurons: 0.9 of the time at the median, 0.8 on average, with :func:`_fetch_next`.
    """
    for i in range(adj_offset[n], adj_offset[n + 1]):
        m = np.int64(adj_node[i])
        prefetch(cost, m)
        prefetch(node_count, m)
        prefetch(neurons, m * neurons.shape[1])
        prefetch(near.node, m)
        prefetch(edge_count, np.int64(adj_edge[i]))


@leaf
def _fetch_next(queue, at, adj_offset, adj_node, adj_edge, adj_length):  # type: ignore[no-untyped-def]
    """Ask for the row of the neuron that now comes first in bucket ``at``."""
    if queue[at] >= 0:
        first = adj_offset[queue[N_BUCKETS + 2 * queue[at]]]
        prefetch(adj_node, first)
        prefetch(adj_edge, first)
        prefetch(adj_length, first)


@leaf
def _begin(node_count, starts, start_cost, cost, parent, entry_cost, queue):  # type: ignore[no-untyped-def]
    """The starts that are not blocked as entries, not arranged yet; returns how many."""
    n_entries = 0
    for k in range(len(starts)):
        n = starts[k]
        if node_count[n] == 0 and start_cost[k] < cost[n]:
            cost[n], parent[n] = start_cost[k], -1
            put(queue, entry_cost, n_entries, n, start_cost[k], np.inf, 0.0, 0)
            n_entries += 1
    return n_entries


@leaf
def _join_cost(n, goals, goal_cost):  # type: ignore[no-untyped-def]
    """The least cost at which neuron ``n`` joins the goal; infinite if it is none of ``goals``."""
    least = np.inf
    for k in range(len(goals)):
        if goals[k] == n:
            least = min(least, goal_cost[k])
    return least


@leaf
def _marks(nodes, shift):  # type: ignore[no-untyped-def]
    """A word in which the bits of ``nodes`` (K,) are set, six bits of a node's number from bit ``shift`` on: most others are told apart."""
    marks = np.int64(0)
    for node in nodes:
        marks |= np.int64(1) << ((np.int64(node) >> shift) & MARK_MASK)
    return marks


@leaf
def _trace(parent, end, path):  # type: ignore[no-untyped-def]
    """Fill ``path`` from the root to ``end``; returns its length."""
    n, length = end, 0
    while n >= 0:
        path[length] = n
        length += 1
        n = parent[n]
    for i in range(length // 2):
        path[i], path[length - 1 - i] = path[length - 1 - i], path[i]
    return length


@leaf
def breadth_first(  # type: ignore[no-untyped-def]
    adj_offset, adj_node, adj_edge, node_count, edge_count, starts, start_cost, goals, goal_cost, level, parent, queue, path
):
    """Wavefront: the way with the fewest neurons, first found in row order.

    Arguments and return as :func:`best_first`; the cost is hops.
    """
    level[:] = -1
    parent[:] = -1
    head, tail = 0, 0
    for k in range(len(starts)):
        n = starts[k]
        if node_count[n] == 0 and start_cost[k] < np.inf and level[n] < 0:
            level[n] = 0
            queue[tail] = n
            tail += 1
    while head < tail:
        n = queue[head]
        head += 1
        for k in range(len(goals)):
            if goals[k] == n and goal_cost[k] < np.inf:
                return _trace(parent, n, path), float(level[n]), head
        for i in range(adj_offset[n], adj_offset[n + 1]):
            m = adj_node[i]
            if level[m] >= 0 or node_count[m] > 0 or edge_count[adj_edge[i]] > 0:
                continue
            level[m] = level[n] + 1
            parent[m] = n
            queue[tail] = m
            tail += 1
    return NOT_FOUND, np.inf, head
