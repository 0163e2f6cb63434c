"""One search by two trees, in slices (:mod:`services.planner.kernels.repair`): on a map, or in the bare joint space."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from services.planner.core.check import Checker
from services.planner.core.neuron_index import index_neurons
from services.planner.kernels import repair as kernel
from services.planner.kernels.cells import Cells
from services.planner.kernels.connect import Graph
from services.planner.kernels.way import new_rooms

__all__ = ["FINER", "Bounds", "Joined", "Known", "TwoTrees", "no_map", "seed_of"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
U64 = NDArray[np.uint64]
# Motions are checked at this share of the step that the curve is checked at, so that the curve, looked at elsewhere, is nearly always free.
FINER = 0.5  # our choice


@dataclass(frozen=True)
class Bounds:
    """Of a search: samples in all and in a slice, nodes that a tree may have beyond the map's, nearest neurons that an end may join."""

    iterations: int
    slice_iterations: int = 25
    nodes: int = 20_000
    connections: int = 64

    def less(self, iterations: int) -> Bounds:
        """What is left after so many samples."""
        return replace(self, iterations=max(0, self.iterations - iterations))


@dataclass(frozen=True, eq=False)
class Joined:
    """``q_rad`` (P, J): start, points on the way, one of the goals; ``neurons`` (P - 2,) int32: which neuron a point is, or -1."""

    q_rad: F64
    neurons: I32


class Known(NamedTuple):
    """What a search knows of its world beforehand: a map, and what of it is blocked (above zero)."""

    graph: Graph
    node_count: I32  # (N,)
    edge_count: I32  # (M,)


def no_map(n_joints: int) -> Known:
    """The map that knows nothing."""
    none, nobody = np.empty(0, dtype=np.int32), np.empty((0, n_joints))
    return Known(Graph(nobody, np.zeros(1, dtype=np.int64), none, none, np.empty(0), index_neurons(nobody)), none, none)


def seed_of(*parts: NDArray[np.generic]) -> U64:
    """(4,) the generator's state that belongs to a question: equal questions, equal states."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(np.int64(part.size).tobytes())
        digest.update(np.ascontiguousarray(part).tobytes())
    return np.frombuffer(digest.digest(), dtype="<u8").astype(np.uint64)


class TwoTrees:
    """A search from a start to any of some goals.

    Args:
        checker: the one check.
        cells: occupied.
        known: a map, or :func:`no_map`.
        q_start: (J,) rad. q_goals: (G, J) rad; all free.
        joint_range: (J,) least and largest joint angles.
        rng: (4,) state of the generator, advanced here.
        bounds: of the search.
    """

    def __init__(
        self, checker: Checker, cells: Cells, known: Known, q_start: F64, q_goals: F64, joint_range: tuple[F64, F64],
        rng: U64, bounds: Bounds,
    ) -> None:  # fmt: skip
        graph, node_count, edge_count = known
        self._bounds, self._ends = bounds, (np.ascontiguousarray(q_start), np.ascontiguousarray(q_goals))
        free, blocked = (np.flatnonzero(is_so).astype(np.int32) for is_so in (node_count == 0, node_count != 0))
        step_m = FINER * checker.step_m
        self._space = kernel.Space(
            checker.arm, checker.solids, cells, checker.safety_m, step_m, *joint_range, graph, node_count, edge_count, free, blocked
        )
        self._trees = _trees(len(node_count), len(edge_count), len(q_start), len(q_goals), len(new_rooms(checker.arm, 1)[0]), rng, bounds)
        self._roots = [(0, 0), *((1, g) for g in range(len(q_goals)))]
        self._state = int(kernel.GROWING)
        kernel.plant(self._trees, *self._ends)

    @property
    def iterations(self) -> int:
        """Samples so far."""
        return int(self._trees.tally[kernel.ITERATIONS])

    def advance(self) -> bool:
        """One slice, at first one for each root; True when the search is over."""
        if self._roots:
            self._state = int(kernel.root_in_map(self._space, self._trees, *self._roots.pop(0), self._bounds.connections))
        elif self._state == kernel.GROWING:
            self._state = int(kernel.grow(self._space, self._trees, self._bounds.slice_iterations, self._bounds.iterations))
        return self._state != kernel.GROWING and not self._roots

    def found(self) -> Joined | None:
        """The way, once the search is over; None: there is none within the bounds."""
        if self._state != kernel.JOINED:
            return None
        nodes = [*((0, i) for i in reversed(self._to_root(0))), *((1, i) for i in self._to_root(1))]
        q = np.array([self._trees.q_rad[node] for node in nodes])
        neurons = np.array([self._trees.neuron[node] for node in nodes], dtype=np.int32)
        new = np.concatenate([[True], np.any(q[1:] != q[:-1], axis=1)])  # both trees may have grown to the same point
        return Joined(q[new], neurons[new][1:-1])

    def _to_root(self, side: int) -> list[int]:
        nodes, i = [], int(self._trees.joint[side])
        while i >= 0:
            nodes.append(i)
            i = int(self._trees.parent[side, i])
        return nodes


def _trees(n_neurons: int, n_edges: int, n_joints: int, n_goals: int, n_rooms: int, rng: U64, bounds: Bounds) -> kernel.Trees:
    room = n_neurons + n_goals + bounds.nodes
    in_heap = 2 * n_edges + n_neurons + 1
    return kernel.Trees(
        q_rad=np.empty((2, room, n_joints)),
        column_rad=np.empty((2, n_joints, room), dtype=np.float32),
        parent=np.empty((2, room), dtype=np.int32),
        neuron=np.empty((2, room), dtype=np.int32),
        n_nodes=np.zeros(2, dtype=np.int64),
        owner=np.empty(n_neurons, dtype=np.int8),
        node_of=np.empty(n_neurons, dtype=np.int32),
        cost=np.empty(n_neurons),
        via=np.empty(n_neurons, dtype=np.int32),
        heap_key=np.empty(in_heap),
        heap_node=np.empty(in_heap, dtype=np.int32),
        rng=rng,
        tally=np.zeros(2, dtype=np.int64),
        best=np.empty(1),
        joint=np.full(2, -1, dtype=np.int64),
        room_m=np.empty((2, room, n_rooms)),
        scratch_rad=np.empty((3, n_joints)),
        scratch_room_m=np.empty(n_rooms),
        scratch_d2=np.empty(kernel.CHUNK, dtype=np.float32),
    )
