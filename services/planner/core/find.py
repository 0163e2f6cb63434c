"""The map as something to search: nearest neurons, the best way between some of them, corners cut."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from services.planner.core.check import Checker
from services.planner.core.found import FoundPath, NotFound
from services.planner.core.near import Near
from services.planner.core.roadmap import Roadmap
from services.planner.core.world import World
from services.planner.kernels.buckets import queue_length
from services.planner.kernels.connect import ASTAR, BIDIRECTIONAL, DIJKSTRA, WAVEFRONT, Ends, Scratch, best_way, connect, join_ends
from services.planner.kernels.neuron_index import nearest_free
from services.planner.kernels.refine import refine
from services.planner.kernels.search import NOT_FOUND
from services.planner.kernels.shorten import cut_corners, has_repeats
from services.planner.kernels.way import new_rooms

__all__ = ["N_CONNECTIONS", "SEARCHES", "Counts", "PathFinder", "Pieces", "Rules"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]
I32 = NDArray[np.int32]
Counts = tuple[I32, I32]  # of neurons (N,) and of edges (M,): blocked while above zero
Rules = Literal["checked", "paper"]
SEARCHES = ("dijkstra", "astar", "bidirectional", "wavefront")  # the first three find equally short paths, the last the fewest neurons
KINDS = {"dijkstra": DIJKSTRA, "astar": ASTAR, "wavefront": WAVEFRONT, "bidirectional": BIDIRECTIONAL}
FREE_OF_CHARGE = Near(np.empty(0, dtype=np.uint8), np.empty(0, dtype=np.uint8), np.empty(0))  # by the paper's rules
MORE_POINTS = 64  # that shortcuts may add to a path
REFINE_STATE = (1, 2, 3, 4)  # of the generator of shortcuts; any that is not all zero
N_CONNECTIONS = 24  # nearest free neurons that start and goal may join; our choice


@dataclass(frozen=True, eq=False)
class Pieces:
    """A path of straight pieces, and what is known of each.

    Attributes:
        q_rad: (P, J) its points.
        proven: (P - 1,) uint8: not zero where a piece is known to be free.
        origin: (P - 1,) the piece of the path as it was found that a piece is, or begins with.
    """

    q_rad: F64
    proven: U8
    origin: I64

    @staticmethod
    def of(found: FoundPath) -> Pieces:
        """A path as it was found; nothing is known."""
        n = len(found.q_rad) - 1
        return Pieces(found.q_rad, np.zeros(n, dtype=np.uint8), np.arange(n))

    def after(self, q_before: F64) -> Pieces:
        """With a free piece before it, from ``q_before`` (J,)."""
        return Pieces(np.vstack([q_before, self.q_rad]), np.insert(self.proven, 0, 1), np.insert(self.origin, 0, -1))

    def without_repeats(self, least_rad: float) -> Pieces:
        """Without pieces that are no longer than ``least_rad``."""
        if not has_repeats(self.q_rad, least_rad):
            return self
        moves = np.linalg.norm(np.diff(self.q_rad, axis=0), axis=1) > least_rad
        return Pieces(self.q_rad[np.insert(moves, 0, True)], self.proven[moves], self.origin[moves])


class PathFinder:
    """Searches one roadmap. Holds scratch buffers, so one per thread; answers depend on the arguments alone.

    Args:
        roadmap: the map.
        checker: of connections and shortcuts.
        surcharges: (L,) by layer of the table, the share by which an edge in that band costs more; empty: nearness costs nothing.
    """

    def __init__(self, roadmap: Roadmap, checker: Checker, surcharges: Sequence[float] = ()) -> None:
        self.roadmap = roadmap
        self.checker = checker
        self.surcharges = np.array(surcharges, dtype=np.float64)
        if len(surcharges) not in (0, roadmap.table.layers.n_bands):
            raise ValueError(f"{len(surcharges)} surcharges for {roadmap.table.layers.n_bands} layers")
        self._factors = np.append(1.0 + self.surcharges, 1.0) if len(surcharges) else np.empty(0)
        n, m = roadmap.n_neurons, roadmap.n_edges
        capacity = N_CONNECTIONS + 2 * m + n + 1
        self.scratch = Scratch(
            cost=np.empty((2, n)),
            parent=np.empty((2, n), dtype=np.int32),
            level=np.empty(n, dtype=np.int32),
            queue=np.empty(n, dtype=np.int32),
            heap_key=np.empty((2, capacity)),
            heap_node=np.empty((2, queue_length(capacity)), dtype=np.int32),
            path=np.empty(n, dtype=np.int32),
        )
        shape, n_rooms = (2, N_CONNECTIONS), new_rooms(checker.arm, 1).shape[1]
        self._no_ends = Ends(
            neuron=np.zeros(shape, dtype=np.int32),
            cost=np.zeros(shape),
            known=np.zeros(shape, dtype=np.int8),
            n=np.zeros(2, dtype=np.int64),
            room_m=np.full((2, n_rooms), np.nan),
        )
        self._none_blocked = np.zeros(n, dtype=np.int32)
        self._no_edges_blocked = np.zeros(m, dtype=np.int32)

    def no_way(self, world: World) -> str:
        """Why the map has no path."""
        return f"no way on the map: {world.counts.n_blocked} of {self.roadmap.n_neurons} neurons blocked"

    def find_paper(self, world: World, q_start: F64, q_goal: F64, search: str) -> FoundPath | NotFound:
        """The paper's own answer: start and goal snap to their best matches, only neurons are blocked (section IV)."""
        ends = []
        for q, outcome, end in ((q_start, "start_blocked", "start"), (q_goal, "goal_blocked", "goal")):
            best, distance = self.nearest(self._none_blocked, q, 1)
            if world.counts.node[best[0]] > 0:
                return NotFound(outcome, f"{end}: its best match, neuron {best[0]}, is blocked")  # type: ignore[arg-type]
            ends.append((best, distance))
        (start, start_cost), (goal, goal_cost) = ends
        neurons = self.search(world.counts.node, self._no_edges_blocked, start, start_cost, goal, goal_cost, q_goal, search)
        if neurons is None:
            return NotFound("no_path", self.no_way(world))
        raw = np.vstack([q_start, self.roadmap.neurons_rad[neurons], q_goal])
        return FoundPath(neurons, raw)

    def best_match(self, q_rad: F64) -> int:
        """The nearest neuron of ``q_rad`` (J,), blocked or not."""
        return int(self.nearest(self._none_blocked, q_rad, 1)[0][0])

    def nearest(self, blocked: I32, q: F64, k: int = N_CONNECTIONS) -> tuple[I32, F64]:
        """The ``k`` nearest neurons of ``q`` (J,) whose count in ``blocked`` (N,) is zero, nearest first, and their distances in rad."""
        index, distance = np.empty(k, dtype=np.int32), np.empty(k)
        n = nearest_free(self.roadmap.index, blocked, q, index, distance)
        return index[:n], distance[:n]

    def search(
        self, node_count: I32, edge_count: I32, start: I32, start_cost: F64, goal: I32, goal_cost: F64, q_goal: F64, search: str
    ) -> I32 | None:
        """Neurons of the shortest path from any of ``start`` to any of ``goal`` at these joining costs; None if there is none."""
        kind, graph = KINDS[search], self.roadmap.graph
        n = best_way(kind, graph, node_count, edge_count, FREE_OF_CHARGE, start, start_cost, goal, goal_cost, q_goal, self.scratch)
        return None if n == NOT_FOUND else self.scratch.path[:n].copy()

    def new_ends(self) -> Ends:
        """Room for the neurons that a question's start and goal may join."""
        return Ends._make(array.copy() for array in self._no_ends)

    def as_built(self, counts: Counts) -> Counts:
        """``counts`` as if all that was learned since the map was built were blocked."""
        node, edge = counts[0].copy(), counts[1].copy()
        node[self.roadmap.n_built :] += 1
        edge[self.roadmap.n_built_edges :] += 1
        return node, edge

    def question(self, world: World, counts: Counts, q_start: F64, q_goal: F64, search: str) -> tuple[Any, ...]:
        """What the kernels are told of a question: map, what is blocked (neurons (N,) and edges (M,), while above zero), checks, ends."""
        c = self.checker
        near = world.counts.near
        nearness = Near(near.node, near.edge, self._factors)
        checks = (c.arm, c.solids, world.cells, c.safety_m, c.step_m)
        return (KINDS[search], self.roadmap.graph, *counts, nearness, *checks, q_start, q_goal)

    def join(self, node_count: I32, q_start: F64, q_goal: F64, ends: Ends) -> None:
        """The nearest neurons of both ends whose count (N,) is zero."""
        join_ends(self.roadmap.graph, node_count, q_start, q_goal, ends)

    def connect(self, world: World, counts: Counts, q_start: F64, q_goal: F64, search: str, ends: Ends) -> I32 | None:
        """Neurons of the best path whose two connections are free; None if there is none."""
        n = connect(*self.question(world, counts, q_start, q_goal, search), ends, self.scratch)
        return None if n == NOT_FOUND else self.scratch.path[:n].copy()

    def refined(self, world: World, found: FoundPath, looks: int, room_m: float = 0.0) -> Pieces:
        """A much shorter free path with the same ends: corners cut, then shortcuts drawn by a generator of fixed state.

        Equal paths get equal ones. ``looks``: straight segments that are looked at, at most. ``room_m``: shortcuts keep so much more from
        cells than they must; corners are not cut then. The piece that leads out of tolerated cells stays as it is.
        """
        c, pieces = self.checker, self.cut_corners(world, found, looks) if room_m == 0.0 else Pieces.of(found)
        n = len(pieces.q_rad)
        path, proven = np.empty((n + MORE_POINTS, pieces.q_rad.shape[1])), np.zeros(n + MORE_POINTS, dtype=np.uint8)
        path[:n], proven[: n - 1] = pieces.q_rad, pieces.proven
        first, rng = 0 if found.leaving is None else 1, np.array(REFINE_STATE, dtype=np.uint64)
        n = refine(c.arm, c.solids, world.cells, c.safety_m + room_m, c.step_m, path, proven, n, first, looks, rng)
        return Pieces(path[:n].copy(), proven[: n - 1].copy(), np.zeros(n - 1, dtype=np.int64))

    def cut_corners(self, world: World, found: FoundPath, checks: int) -> Pieces:
        """A shorter free path with the same ends.

        Points are skipped from the start on: the farthest point that a free straight segment reaches, by halving; at most ``checks``
        segments are tried. The piece that leads out of tolerated cells stays as it is.
        """
        c, path = self.checker, np.ascontiguousarray(found.q_rad)
        kept, proven = np.empty(len(path), dtype=np.int64), np.empty(len(path), dtype=np.uint8)
        first = 0 if found.leaving is None else 1
        n = cut_corners(c.arm, c.solids, world.cells, c.safety_m, c.step_m, path, first, checks, kept, proven)
        pieces = Pieces(path[kept[:n]], proven[: n - 1], kept[: n - 1])
        # The search looked at its connections itself, repair and fallback at all of it, more closely than here: to look once more in other
        # places would only find what lies a hair within the safety distance, in the narrow places that they are for.
        if found.way != "map":
            pieces.proven[:] = 1
        pieces.proven[0] = 1
        if pieces.origin[-1] == len(path) - 2:
            pieces.proven[-1] = 1
        return pieces
