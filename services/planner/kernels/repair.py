"""RRTConnect (Kuffner and LaValle 2000) whose two trees begin with what the map knows, in slices, bounded by counts alone.

Tree 0 holds the start and every neuron that can be reached from it on the unblocked map, tree 1 likewise the goals. Samples are free
neurons of other parts of the map (a part that is reached is taken in whole), points between the trees, points about what is blocked or
reached, and points of the joint box. A tree grows towards one by steps that are wholly free. On a map without neurons this is RRTConnect
itself.
Twin: ``tests/support/slow_repair.py``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from common.kernel import copy_row, kernel, leaf
from services.planner.kernels.connect import Graph
from services.planner.kernels.neuron_index import nearest_free
from services.planner.kernels.search import pop, push
from services.planner.kernels.way import line_between_is_free
from services.planner.kernels.xoshiro import uniform

__all__ = ["CHUNK", "EXHAUSTED", "GROWING", "JOINED", "Space", "Trees", "grow", "plant", "root_in_map"]

F64 = NDArray[np.float64]
F32 = NDArray[np.float32]
I64 = NDArray[np.int64]
I32 = NDArray[np.int32]
I8 = NDArray[np.int8]
U64 = NDArray[np.uint64]

GROWING, JOINED, EXHAUSTED = 0, 1, 2
SIDE, ITERATIONS = 0, 1  # places in Trees.tally
SAMPLE, MIDDLE, END = 0, 1, 2  # rows of Trees.scratch_rad
NO_NEURON = -1
NOBODY = -1
RANGE_RAD = 1.0  # longest growth towards a point that is no neuron, and longest step, as in core.rrt_connect; our choice
# Of the samples: free neurons of no tree, points between the trees, points near nodes of the tree that grows, points about blocked neurons
# (the ways round lie about what is cut off); the rest, and what there is none of, are points of the box. Measured on the 28 questions of
# 1 000 (task, seed 11) that the map does not answer though they can be, 3 generators each, 2 000 samples, share solved and mean time:
# (0.1, 0.2, 0.1, 0.5) 0.79 and 86 ms, (0.1, 0.4, 0.1, 0.3) 0.81 and 78 ms, (0.1, 0.6, 0.1, 0.1) 0.81 and 85 ms.
SHARES = (0.1, 0.4, 0.1, 0.3)
# The same without a map, 90 000 samples: nodes of the other tree themselves, as RRTConnect has them in turn, took 0.125 s at the median,
# points between the trees 0.049 s.
SHARES_WITHOUT_MAP = (0.0, 0.5, 0.2, 0.0)
BETWEEN_RAD, NEAR_RAD, BLOCKED_RAD = 1.0, 0.5, 2.0  # each joint is at most so far from the point's, the node's, the neuron's
CHUNK = 128  # nodes whose distances are taken joint by joint, so that the compiler takes several at once; our choice
# What single precision may add to the squared distance s of a node. For values of up to 8 (rad, m) a joint's difference d is off by
# e = 1e-6 at most, its square by 2 d e + e^2, and 2 d e <= d^2 / 10^4 + 10^4 e^2: in all s / 10^4, 10^-8 for each joint, and 10^-6 s that
# rounding adds to the sum. Twice that.
ROUNDED, ROUNDED_RAD2 = 1.0 + 2e-4, 1e-6
NEURON_DRAWS = 8  # until a free neuron of no tree is met


class Space(NamedTuple):
    """What is searched: the check with its cells, the joint box, and the map with what is blocked on it."""

    arm: object  # kernels.collision.Arm
    solids: object  # kernels.static_layer.Solids
    cells: object  # kernels.cells.Cells
    safety_m: float
    step_m: float
    q_min: F64  # (J,) rad
    q_max: F64
    graph: Graph  # N neurons, possibly none, and M edges
    node_count: I32  # (N,) blocked while above zero
    edge_count: I32  # (M,)
    free: I32  # (F,) the neurons that are not blocked, ascending
    blocked: I32  # (N - F,) the others, ascending


class Trees(NamedTuple):
    """Two trees, from the start (0) and from the goals (1), with room for K nodes each; all of the search's state."""

    q_rad: F64  # (2, K, J)
    column_rad: F32  # (2, J, K) the same joint by joint, in single precision, for who looks at all of them
    parent: I32  # (2, K), -1 of a root
    neuron: I32  # (2, K) the neuron that a node is, or -1
    n_nodes: I64  # (2,)
    owner: I8  # (N,) tree of a neuron, or -1
    node_of: I32  # (N,) its node there
    cost: F64  # (N,) rad from where its part of the map was reached
    via: I32  # (N,) node that it is reached from
    heap_key: F64  # (2 M + N + 1,)
    heap_node: I32
    rng: U64  # (4,)
    tally: I64  # (2,) whose turn it is, iterations so far
    best: F64  # (1,) rad, length of the way over the map that ``joint`` tells, while goals are joined with it
    joint: I64  # (2,) the nodes, one a tree, between which the straight way is free
    room_m: F64  # (2, K, 2 B + P) rooms of the nodes, as kernels.way fills them; NaN in the first place: not looked at yet
    scratch_rad: F64  # (3, J) of a sample, its middle, the end of a step
    scratch_room_m: F64  # (2 B + P,) of the end of a step
    scratch_d2: F32  # (CHUNK,)


@leaf
def _squared_distance(a, b):  # type: ignore[no-untyped-def]
    total = 0.0
    for j in range(len(a)):
        total += (a[j] - b[j]) ** 2
    return total


@leaf
def _distance(a, b):  # type: ignore[no-untyped-def]
    return math.sqrt(_squared_distance(a, b))


@leaf
def _nearest(trees, side, q):  # type: ignore[no-untyped-def]
    """The node of a tree that is nearest to ``q``; of equals the first.

    Single precision, which takes half as long, says which nodes may be; those are looked at exactly.
    """
    best, best_d2, may_be, d2 = 0, np.inf, np.float32(np.inf), trees.scratch_d2
    n_nodes = trees.n_nodes[side]
    for first in range(0, n_nodes, CHUNK):
        n = min(CHUNK, n_nodes - first)
        d2[:n] = 0.0
        for j in range(len(q)):
            column, at = trees.column_rad[side, j, first : first + n], np.float32(q[j])
            for i in range(n):
                d2[i] += (column[i] - at) * (column[i] - at)
        n_may_be = 0
        for i in range(n):  # several at once, too: most chunks hold none
            n_may_be += d2[i] <= may_be
        for i in range(n if n_may_be > 0 else 0):
            if d2[i] <= may_be:
                exact = _squared_distance(trees.q_rad[side, first + i], q)
                if exact < best_d2:
                    best, best_d2, may_be = first + i, exact, np.float32(exact * ROUNDED + ROUNDED_RAD2)
    return best


@leaf
def _append(trees, side, q, parent, neuron):  # type: ignore[no-untyped-def]
    """A new node; the caller has made sure that there is room."""
    i = trees.n_nodes[side]
    copy_row(q, trees.q_rad[side, i])
    for j in range(len(q)):
        trees.column_rad[side, j, i] = q[j]
    trees.parent[side, i], trees.neuron[side, i], trees.room_m[side, i, 0] = parent, neuron, np.nan
    trees.n_nodes[side] = i + 1
    return i


@leaf
def _is_free(space, q_a, room_a_m, q_b, room_b_m):  # type: ignore[no-untyped-def]
    """Whether the straight way from a pose that is free is free; the rooms are as in kernels.way."""
    return line_between_is_free(space.arm, space.solids, space.cells, space.safety_m, space.step_m, q_a, q_b, room_a_m, room_b_m)


@leaf
def _take_in(space, trees, side, size):  # type: ignore[no-untyped-def]
    """Everything that can be reached on the map from the ``size`` neurons in the heap becomes part of a tree, nearest first."""
    while size > 0:
        key, n = trees.heap_key[0], trees.heap_node[0]
        size = pop(trees.heap_key, trees.heap_node, size)
        if trees.owner[n] != NOBODY or trees.n_nodes[side] == trees.parent.shape[1]:
            continue
        node = _append(trees, side, space.graph.neurons_rad[n], trees.via[n], n)
        trees.owner[n], trees.node_of[n] = side, node
        for i in range(space.graph.adj_offset[n], space.graph.adj_offset[n + 1]):
            m = space.graph.adj_node[i]
            through = key + space.graph.adj_length[i]
            if (
                space.node_count[m] == 0
                and space.edge_count[space.graph.adj_edge[i]] == 0
                and trees.owner[m] == NOBODY
                and through < trees.cost[m]
            ):
                trees.cost[m], trees.via[m] = through, node
                size = push(trees.heap_key, trees.heap_node, size, through, m)


@leaf
def plant(trees, q_start, q_goals):  # type: ignore[no-untyped-def]
    """Begin with the roots alone: ``q_start`` (J,), ``q_goals`` (G, J) rad, all free. ``trees.rng`` is left as it is."""
    trees.n_nodes[:], trees.tally[:], trees.joint[:] = 0, 0, -1
    trees.owner[:], trees.cost[:], trees.best[0] = NOBODY, np.inf, np.inf
    _append(trees, 0, q_start, -1, NO_NEURON)
    for g in range(len(q_goals)):
        _append(trees, 1, q_goals[g], -1, NO_NEURON)


@kernel
def root_in_map(space, trees, side, root, n_connections):  # type: ignore[no-untyped-def]
    """Join a root with its nearest free neurons by checked straight ways; the start first, then the goals, each in its turn.

    What a neuron leads to is taken in at once, and not looked at again: where most of the map hangs together, one way is enough.

    Returns:
        JOINED if the map leads to one of the goals so far (``trees.joint``: where the way is shortest), else GROWING.
    """
    index, distance = np.empty(n_connections, dtype=np.int32), np.empty(n_connections)
    q, room_m = trees.q_rad[side, root], np.empty(trees.room_m.shape[2])
    for k in range(nearest_free(space.graph.near, space.node_count, q, index, distance)):
        n = index[k]
        room_m[0] = np.nan
        if trees.owner[n] == side or not _is_free(space, q, trees.room_m[side, root], space.graph.neurons_rad[n], room_m):
            continue
        if trees.owner[n] == NOBODY:
            trees.cost[n], trees.via[n] = distance[k], root
            _take_in(space, trees, side, push(trees.heap_key, trees.heap_node, 0, distance[k], n))
            continue
        if distance[k] + trees.cost[n] < trees.best[0]:  # the start reaches it, and a goal is being joined
            trees.best[0] = distance[k] + trees.cost[n]
            trees.joint[0], trees.joint[1] = trees.node_of[n], root
        break
    return JOINED if trees.best[0] < np.inf else GROWING


@leaf
def _march(space, trees, side, origin, target, reach_rad):  # type: ignore[no-untyped-def]
    """Steps from node ``origin`` straight to ``target``, at most ``reach_rad``, each wholly free; the target itself is left out.

    Of a step that is blocked nothing is kept: most are, and that shows early where it is not asked how far they are free. Measured:
    repair takes half of the time for as many solved, a search without a map a third; single questions are lost.

    Returns:
        (whether the target was reached, the last node).
    """
    walked, room_m, end = 0.0, trees.scratch_room_m, trees.scratch_rad[END]
    while True:
        start = trees.q_rad[side, origin]
        far = _distance(start, target)
        if far == 0.0:
            return True, origin
        share = min(1.0, RANGE_RAD / far)
        for j in range(len(end)):
            end[j] = start[j] + share * (target[j] - start[j])
        room_m[0] = np.nan
        if trees.n_nodes[side] == trees.parent.shape[1] or not _is_free(space, start, trees.room_m[side, origin], end, room_m):
            return False, origin
        if share == 1.0:
            return True, origin
        origin = _append(trees, side, end, origin, NO_NEURON)
        copy_row(room_m, trees.room_m[side, origin])
        walked += RANGE_RAD
        if walked >= reach_rad:
            return False, origin


@leaf
def _about(space, trees, middle, most_rad, q):  # type: ignore[no-untyped-def]
    """Fill ``q`` with a point of the box whose joints are at most ``most_rad`` from those of ``middle``."""
    for j in range(len(q)):
        near = middle[j] + (2.0 * uniform(trees.rng) - 1.0) * most_rad
        q[j] = min(max(near, space.q_min[j]), space.q_max[j])


@leaf
def _between(space, trees, side, q):  # type: ignore[no-untyped-def]
    """Fill ``q`` with a point about the straight way from a node of the other tree to the one of this tree that is nearest to it.

    What keeps two grown trees apart is narrow and lies there. The nodes themselves, sampled again and again, would be tried by the same
    way each time.
    """
    other = trees.q_rad[1 - side, int(uniform(trees.rng) * trees.n_nodes[1 - side])]
    mine, share, middle = trees.q_rad[side, _nearest(trees, side, other)], uniform(trees.rng), trees.scratch_rad[MIDDLE]
    for j in range(len(q)):
        middle[j] = other[j] + share * (mine[j] - other[j])
    _about(space, trees, middle, BETWEEN_RAD, q)


@leaf
def _sample(space, trees, side, q):  # type: ignore[no-untyped-def]
    """Fill ``q`` with where to grow to; the neuron that it is, or -1."""
    neurons, between, near, blocked = SHARES if len(space.node_count) > 0 else SHARES_WITHOUT_MAP
    kind = uniform(trees.rng)
    if kind < neurons:
        for _ in range(NEURON_DRAWS if len(space.free) > 0 else 0):
            n = space.free[int(uniform(trees.rng) * len(space.free))]
            if trees.owner[n] == NOBODY:
                copy_row(space.graph.neurons_rad[n], q)
                return n
    elif kind < neurons + between:
        _between(space, trees, side, q)
        return NO_NEURON
    elif kind < neurons + between + near:
        _about(space, trees, trees.q_rad[side, int(uniform(trees.rng) * trees.n_nodes[side])], NEAR_RAD, q)
        return NO_NEURON
    elif kind < neurons + between + near + blocked and len(space.blocked) > 0:
        _about(space, trees, space.graph.neurons_rad[space.blocked[int(uniform(trees.rng) * len(space.blocked))]], BLOCKED_RAD, q)
        return NO_NEURON
    for j in range(len(q)):
        q[j] = space.q_min[j] + uniform(trees.rng) * (space.q_max[j] - space.q_min[j])
    return NO_NEURON


@leaf
def grow(space, trees, n_iterations, max_iterations):  # type: ignore[no-untyped-def]
    """Go on with the search for ``n_iterations`` samples; where it is cut into slices makes no difference.

    Args:
        space: must not change between the slices of a search.
        trees: as left by :func:`root_in_map` or by the slice before.
        n_iterations: of this slice. max_iterations: of the whole search.

    Returns:
        GROWING; JOINED: the way leads over ``trees.joint``; EXHAUSTED: by count or for want of room.
    """
    q = trees.scratch_rad[SAMPLE]
    for _ in range(n_iterations):
        if trees.tally[ITERATIONS] >= max_iterations or max(trees.n_nodes[0], trees.n_nodes[1]) == trees.parent.shape[1]:
            return EXHAUSTED
        trees.tally[ITERATIONS] += 1
        side = trees.tally[SIDE]
        other = 1 - side
        trees.tally[SIDE] = other
        neuron = _sample(space, trees, side, q)
        origin, reach_rad = _nearest(trees, side, q), RANGE_RAD if neuron == NO_NEURON else np.inf
        reached, last = _march(space, trees, side, origin, q, reach_rad)
        if reached and neuron != NO_NEURON:
            first = trees.n_nodes[side]
            trees.cost[neuron], trees.via[neuron] = 0.0, last
            _take_in(space, trees, side, push(trees.heap_key, trees.heap_node, 0, 0.0, neuron))
            last = min(first, trees.n_nodes[side] - 1)
        elif reached and trees.n_nodes[side] < trees.parent.shape[1]:
            last = _append(trees, side, q, last, NO_NEURON)
        elif last == origin:
            continue
        met = trees.q_rad[side, last]
        reached, at = _march(space, trees, other, _nearest(trees, other, met), met, np.inf)
        if reached:
            trees.joint[side], trees.joint[other] = last, at
            return JOINED
    return GROWING
