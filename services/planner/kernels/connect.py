"""From a question to neurons in one call: start and goal looked at, the straight way tried, both joined to the map, the map searched.

A connection to the map is checked when the search wants to use it (most never are): the first search takes all of them for free. Where it
uses one that is not, that end's connections are checked, nearest first, until some are free, and the search is repeated with those.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from common.kernel import kernel, leaf
from services.planner.kernels.bidirectional import both_ends
from services.planner.kernels.collision import FREE, pose_verdict
from services.planner.kernels.neuron_index import NeuronIndex, nearest_free
from services.planner.kernels.search import NOT_FOUND, best_first, breadth_first
from services.planner.kernels.way import line_between_is_free, new_rooms, pose_room

__all__ = [
    "ASTAR",
    "BIDIRECTIONAL",
    "DIJKSTRA",
    "DIRECT",
    "FOUND",
    "GOAL_BLOCKED",
    "NO_WAY",
    "START_BLOCKED",
    "WAVEFRONT",
    "Ends",
    "Graph",
    "Scratch",
    "ask_map",
    "best_way",
    "connect",
    "join_ends",
]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]
I8 = NDArray[np.int8]

DIJKSTRA, ASTAR, WAVEFRONT, BIDIRECTIONAL = 0, 1, 2, 3
FOUND, DIRECT, NO_WAY, START_BLOCKED, GOAL_BLOCKED = 0, 1, 2, 3, 4
UNKNOWN, JOINS, BARRED = 0, 1, 2
START, GOAL = 0, 1
FREE_CONNECTIONS = 6  # free ones that are enough for an end whose first choice was blocked; our choice
SEARCHES = 3  # one as if all connections were free, one after each end was looked into


class Graph(NamedTuple):
    """A map as the searches see it."""

    neurons_rad: F64  # (N, J)
    adj_offset: I64  # (N + 1,) rows of neighbours
    adj_node: I32  # (2 M,)
    adj_edge: I32  # (2 M,)
    adj_length: F64  # (2 M,) rad
    near: NeuronIndex


class Ends(NamedTuple):
    """Row 0: the neurons that the start may join, nearest first; row 1: the goal's."""

    neuron: I32  # (2, K)
    cost: F64  # (2, K) rad; infinite: not to be used
    known: I8  # (2, K) UNKNOWN, JOINS, BARRED
    n: I64  # (2,) how many of the K there are
    room_m: F64  # (2, 2 B + P) of the start and the goal themselves, as kernels.way fills it; NaN in the first place: not looked at yet


class Scratch(NamedTuple):
    """Buffers of the searches; row 1 of four of them is for the half from the goals, of the bidirectional search alone."""

    cost: F64  # (2, N)
    parent: I32  # (2, N)
    level: I32  # (N,)
    queue: I32  # (N,)
    heap_key: F64  # (2, K + 2 M + N + 1)
    heap_node: I32  # (2, more): also the queue of buckets, see kernels.buckets
    path: I32  # (N,)


@leaf
def best_way(kind, graph, node_count, edge_count, near, start, start_cost, goal, goal_cost, q_goal, scratch):  # type: ignore[no-untyped-def]
    """Number of neurons in ``scratch.path`` from any of ``start`` to any of ``goal`` at these joining costs, or ``NOT_FOUND``."""
    g, s = graph, scratch
    if kind == WAVEFRONT:
        n, _, _ = breadth_first(
            g.adj_offset, g.adj_node, g.adj_edge, node_count, edge_count,
            start, start_cost, goal, goal_cost, s.level, s.parent[0], s.queue, s.path,
        )  # fmt: skip
        return n
    if kind == BIDIRECTIONAL:
        n, _, _ = both_ends(
            g.adj_offset, g.adj_node, g.adj_edge, g.adj_length, node_count, edge_count, near,
            start, start_cost, goal, goal_cost, s.cost, s.parent, s.heap_key, s.heap_node, s.path,
        )  # fmt: skip
        return n
    n, _, _ = best_first(
        g.neurons_rad, g.adj_offset, g.adj_node, g.adj_edge, g.adj_length, node_count, edge_count, near,
        start, start_cost, goal, goal_cost, q_goal, kind == ASTAR, s.cost[0], s.parent[0], s.heap_key[0], s.heap_node[0], s.path,
    )  # fmt: skip
    return n


@leaf
def join_ends(graph, node_count, q_start, q_goal, ends):  # type: ignore[no-untyped-def]
    """Fill ``ends`` with the nearest unblocked neurons of both ends; nothing is known of the connections."""
    ends.n[START] = nearest_free(graph.near, node_count, q_start, ends.neuron[START], ends.cost[START])
    ends.n[GOAL] = nearest_free(graph.near, node_count, q_goal, ends.neuron[GOAL], ends.cost[GOAL])
    ends.known[:] = UNKNOWN


@kernel
def _joins(arm, solids, cells, safety_m, step_m, graph, q_end, end, k, ends):  # type: ignore[no-untyped-def]
    """Whether connection ``k`` of an end is free; looked at once."""
    if ends.known[end, k] == UNKNOWN:
        q, room_m, room_end_m = graph.neurons_rad[ends.neuron[end, k]], new_rooms(arm, 1)[0], ends.room_m[end]
        line = (q_end, q, room_end_m, room_m) if end == START else (q, q_end, room_m, room_end_m)
        free = line_between_is_free(arm, solids, cells, safety_m, step_m, *line)
        ends.known[end, k] = JOINS if free else BARRED
    return ends.known[end, k] == JOINS


@leaf
def connect(kind, graph, node_count, edge_count, near, arm, solids, cells, safety_m, step_m, q_start, q_goal, ends, scratch):  # type: ignore[no-untyped-def]
    """Number of neurons in ``scratch.path`` of the best way whose two connections are free, or ``NOT_FOUND``."""
    for _ in range(SEARCHES):
        n_start, n_goal = ends.n[START], ends.n[GOAL]
        n = best_way(
            kind, graph, node_count, edge_count, near, ends.neuron[START, :n_start], ends.cost[START, :n_start],
            ends.neuron[GOAL, :n_goal], ends.cost[GOAL, :n_goal], q_goal, scratch,
        )  # fmt: skip
        if n == NOT_FOUND:
            return NOT_FOUND
        free = True
        for end in range(2):
            q_end, used = (q_start, scratch.path[0]) if end == START else (q_goal, scratch.path[n - 1])
            for k in range(ends.n[end]):
                if ends.neuron[end, k] == used and not _joins(arm, solids, cells, safety_m, step_m, graph, q_end, end, k, ends):
                    free = False
                    _settle(arm, solids, cells, safety_m, step_m, graph, q_end, end, ends)
                    break
        if free:
            return n
    return NOT_FOUND


@leaf
def _settle(arm, solids, cells, safety_m, step_m, graph, q_end, end, ends):  # type: ignore[no-untyped-def]
    """Check an end's connections, nearest first, until some are free, and leave only free ones to the search."""
    n_free = 0
    for k in range(ends.n[end]):
        usable = n_free < FREE_CONNECTIONS and _joins(arm, solids, cells, safety_m, step_m, graph, q_end, end, k, ends)
        n_free += usable
        if not usable:
            ends.cost[end, k] = np.inf


@kernel
def ask_map(kind, graph, node_count, edge_count, near, arm, solids, cells, safety_m, step_m, q_start, q_goal, ends, scratch):  # type: ignore[no-untyped-def]
    """The whole question.

    Args:
        kind: DIJKSTRA, ASTAR, WAVEFRONT or BIDIRECTIONAL.
        graph: the map. node_count (N,), edge_count (M,): blocked while above zero. near: what nearness costs.
        arm, solids, cells, safety_m, step_m: as for the checks.
        q_start, q_goal: (J,) rad.
        ends: with rooms that were not looked at; filled here, for questions that go on from there.
        scratch: ``scratch.path`` holds the neurons of the answer.

    Returns:
        (FOUND | DIRECT | NO_WAY | START_BLOCKED | GOAL_BLOCKED, number of neurons, verdict and index of what blocks an end).
    """
    rotation, translation = np.empty((len(q_start) + 1, 3, 3)), np.empty((len(q_start) + 1, 3))
    for q, room_m, outcome in ((q_start, ends.room_m[START], START_BLOCKED), (q_goal, ends.room_m[GOAL], GOAL_BLOCKED)):
        if not pose_room(arm, solids, cells, safety_m, q, room_m):
            verdict, index = pose_verdict(arm, solids, cells, safety_m, q, rotation, translation)
            return outcome, 0, verdict, index
    if line_between_is_free(arm, solids, cells, safety_m, step_m, q_start, q_goal, ends.room_m[START], ends.room_m[GOAL]):
        return DIRECT, 0, FREE, -1
    join_ends(graph, node_count, q_start, q_goal, ends)
    n = connect(kind, graph, node_count, edge_count, near, arm, solids, cells, safety_m, step_m, q_start, q_goal, ends, scratch)
    return (NO_WAY, 0, FREE, -1) if n == NOT_FOUND else (FOUND, n, FREE, -1)
