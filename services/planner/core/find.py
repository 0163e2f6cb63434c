"""From a question to a path: join start and goal to the map, search what is free, cut corners.

``rules="checked"``: the true start and goal join the map by connections to the nearest free neurons; a connection is checked when the
search wants to use it (most never are). ``rules="paper"``: start and
goal snap to their best matches, only neurons are blocked, nothing else is checked (Steffen et al. 2022, section IV).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from services.planner.core.check import Checker
from services.planner.core.roadmap import Roadmap
from services.planner.core.world import Leaving, World
from services.planner.kernels.bidirectional import both_ends
from services.planner.kernels.collision import FREE
from services.planner.kernels.path import nearest_free
from services.planner.kernels.search import NOT_FOUND, best_first, breadth_first

__all__ = ["SEARCHES", "FoundPath", "NotFound", "PathFinder", "Route", "path_length"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
Rules = Literal["checked", "paper"]
SEARCHES = ("dijkstra", "astar", "bidirectional", "wavefront")  # the first three find equally short paths, the last the fewest neurons
N_CONNECTIONS = 24  # nearest free neurons that start and goal may join; our choice
FREE_CONNECTIONS = 6  # free ones that are enough for an end whose first choice was blocked; our choice


@dataclass(frozen=True, eq=False)
class FoundPath:
    """A free path.

    Attributes:
        neurons: (N,) int32 neurons on the way, may be empty (a straight line).
        q_rad: (N + 2, J) true start, neurons, true goal.
        length_rad: Euclidean joint length of ``q_rad``.
        leaving: the cells among which the arm stands at the start and which it must move away from; None = it stands free.
    """

    neurons: I32
    q_rad: F64
    length_rad: float
    leaving: Leaving | None = None


@dataclass(frozen=True)
class NotFound:
    """Why there is no path: an expected outcome."""

    outcome: Literal["no_path", "start_blocked", "goal_blocked"]
    reason: str


def path_length(q_rad: F64) -> float:
    """Euclidean joint length in rad of a polyline (P, J)."""
    return float(np.linalg.norm(np.diff(q_rad, axis=0), axis=1).sum())


class _End:
    """One end of a question: the neurons it may join, and which of these connections are known to be free."""

    def __init__(self, index: I32, distance: F64, is_free: Callable[[F64], bool]) -> None:
        self.index = index
        self.cost = distance.copy()
        self._is_free = is_free
        self._known: dict[int, bool] = {}

    def holds(self, neuron: int, neurons_rad: F64) -> bool:
        """Whether the connection to ``neuron`` is free."""
        if int(neuron) not in self._known:
            self._known[int(neuron)] = self._is_free(neurons_rad[neuron])
        return self._known[int(neuron)]

    def ban(self, neuron: int) -> None:
        """The connection to ``neuron`` is not free, whatever was thought of it."""
        self._known[int(neuron)] = False
        self.cost[self.index == neuron] = np.inf

    def settle(self, neurons_rad: F64) -> None:
        """Check, nearest first, until ``FREE_CONNECTIONS`` are free, and leave only free ones to the search."""
        n_free = 0
        for k, neuron in enumerate(self.index):
            usable = n_free < FREE_CONNECTIONS and self.holds(neuron, neurons_rad)
            n_free += usable
            if not usable:
                self.cost[k] = np.inf


class PathFinder:
    """Searches one roadmap. Holds scratch buffers, so one per thread; answers depend on the arguments alone."""

    def __init__(self, roadmap: Roadmap, checker: Checker) -> None:
        self.roadmap = roadmap
        self.checker = checker
        n, m = roadmap.n_neurons, roadmap.n_edges
        self._cost, self._parent = np.empty((2, n)), np.empty((2, n), dtype=np.int32)  # row 1: from the goals, bidirectional only
        self._level, self._queue = np.empty(n, dtype=np.int32), np.empty(n, dtype=np.int32)
        capacity = N_CONNECTIONS + 2 * m + n + 1
        self._heap_key, self._heap_node = np.empty((2, capacity)), np.empty((2, capacity), dtype=np.int32)
        self._path = np.empty(n, dtype=np.int32)
        self._none_blocked = np.zeros(n, dtype=np.int32)
        self._no_edges_blocked = np.zeros(m, dtype=np.int32)

    def find(self, world: World, q_start: F64, q_goal: F64, *, rules: Rules, search: str) -> FoundPath | NotFound:
        """A path from ``q_start`` to ``q_goal`` (J,) among the cells.

        Args:
            world: the occupied cells and what they block.
            rules, search: see the module; ``search`` is one of :data:`SEARCHES`.
        """
        if rules == "paper":
            return self._find_paper(world, q_start, q_goal, search)
        route = self.route(world, q_start, q_goal, search=search)
        return route if isinstance(route, NotFound) else route.find()

    def route(self, world: World, q_start: F64, q_goal: F64, *, search: str) -> Route | NotFound:
        """The question of :meth:`find` by checked rules, to be asked once or, with parts of the answer banned, again."""
        leaving = None
        verdict, index = self.checker.pose(world.cells, q_start)
        if verdict != FREE:
            leaving = world.leaving(self.checker, q_start)
            if leaving is None:
                return NotFound("start_blocked", f"start: {self.checker.describe(verdict, index)}")
            world = leaving.rest
        verdict, index = self.checker.pose(world.cells, q_goal)
        if verdict != FREE:
            return NotFound("goal_blocked", f"goal: {self.checker.describe(verdict, index)}")
        return Route(self, world, leaving, q_start, q_goal, search)

    def no_way(self, world: World) -> str:
        """Why the map has no path."""
        return f"no way on the map: {world.counts.n_blocked} of {self.roadmap.n_neurons} neurons blocked"

    def _find_paper(self, world: World, q_start: F64, q_goal: F64, search: str) -> FoundPath | NotFound:
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
        return FoundPath(neurons, raw, path_length(raw))

    def best_match(self, q_rad: F64) -> int:
        """The nearest neuron of ``q_rad`` (J,), blocked or not."""
        return int(self.nearest(self._none_blocked, q_rad, 1)[0][0])

    def nearest(self, blocked: I32, q: F64, k: int = N_CONNECTIONS) -> tuple[I32, F64]:
        """The ``k`` nearest neurons of ``q`` (J,) whose count in ``blocked`` (N,) is zero, nearest first, and their distances in rad."""
        index, distance = np.empty(k, dtype=np.int32), np.empty(k)
        n = nearest_free(self.roadmap.neurons_rad, blocked, q, index, distance)
        return index[:n], distance[:n]

    def search(
        self, node_count: I32, edge_count: I32, start: I32, start_cost: F64, goal: I32, goal_cost: F64, q_goal: F64, search: str
    ) -> I32 | None:
        """Neurons of the best path from any of ``start`` to any of ``goal`` at these joining costs; None if there is none."""
        r = self.roadmap
        graph = (r.adj_offset, r.adj_node, r.adj_edge)
        ends = (start, start_cost, goal, goal_cost)
        if search == "wavefront":
            n, _, _ = breadth_first(*graph, node_count, edge_count, *ends, self._level, self._parent[0], self._queue, self._path)
        elif search == "bidirectional":
            scratch = (self._cost, self._parent, self._heap_key, self._heap_node)
            n, _, _ = both_ends(*graph, r.adj_length, node_count, edge_count, *ends, *scratch, self._path)
        else:
            bound = (q_goal, search == "astar")
            scratch = (self._cost[0], self._parent[0], self._heap_key[0], self._heap_node[0])
            n, _, _ = best_first(r.neurons_rad, *graph, r.adj_length, node_count, edge_count, *ends, *bound, *scratch, self._path)
        return None if n == NOT_FOUND else self._path[:n].copy()

    def cut_corners(self, world: World, found: FoundPath, checks: int) -> F64:
        """(P, J) a shorter free path with the same ends.

        Points are skipped from the start on: the farthest point that a free straight segment reaches, by halving; at most ``checks``
        segments are tried. A path that leads out of tolerated cells stays as it is.
        """
        path = found.q_rad
        if found.leaving is not None:
            return path
        kept = [0]
        while kept[-1] < len(path) - 1:
            here, ahead = kept[-1], len(path) - 1
            while ahead > here + 1:
                if checks <= 0:
                    ahead = here + 1
                    break
                checks -= 1
                if self.checker.segment(world.cells, path[here], path[ahead]):
                    break
                ahead = here + max(1, (ahead - here) // 2)
            kept.append(ahead)
        return np.asarray(path[kept])


class Route:
    """One question that may be asked again: where an exact look at the answer finds a piece blocked, that piece is banned.

    The map's edges are checked at the table's samples and connections at theirs, so a finer look may still find a touch between them. The
    map is not at its end then: the search goes on without that piece.
    """

    def __init__(self, finder: PathFinder, world: World, leaving: Leaving | None, q_start: F64, q_goal: F64, search: str) -> None:
        self._finder, self._world, self._leaving = finder, world, leaving
        self._q_start, self._q_goal, self._search = q_start, q_goal, search
        self._edge_count = world.counts.edge
        self._try_direct = True
        self._ends: tuple[_End, _End] | None = None

    def find(self) -> FoundPath | NotFound:
        """The best path of those not banned."""
        if self._try_direct and self._joins(self._q_goal):
            return self._found(np.empty(0, dtype=np.int32))
        self._try_direct = False
        neurons = self._search_connected()
        return NotFound("no_path", self._finder.no_way(self._world)) if neurons is None else self._found(neurons)

    def ban(self, found: FoundPath, piece: int) -> None:
        """Never again use the straight piece from ``found.q_rad[piece]`` to the next point."""
        if len(found.neurons) == 0:
            self._try_direct = False
        elif piece <= 0:
            self._both_ends()[0].ban(found.neurons[0])
        elif piece >= len(found.neurons):
            self._both_ends()[1].ban(found.neurons[-1])
        else:
            if self._edge_count is self._world.counts.edge:
                self._edge_count = self._edge_count.copy()
            self._edge_count[self._finder.roadmap.edge_between(found.neurons[piece - 1], found.neurons[piece])] += 1

    def _found(self, neurons: I32) -> FoundPath:
        raw = np.vstack([self._q_start, self._finder.roadmap.neurons_rad[neurons], self._q_goal])
        return FoundPath(neurons, raw, path_length(raw), self._leaving)

    def _joins(self, q: F64) -> bool:
        """Whether the straight way from the start is free and, for an arm that stands among cells, leads out of them."""
        checker, leaving = self._finder.checker, self._leaving
        free = checker.segment(self._world.cells, self._q_start, q)
        return free and (leaving is None or leaving.is_way_out(checker, self._q_start, q))

    def _both_ends(self) -> tuple[_End, _End]:
        if self._ends is None:
            finder, world = self._finder, self._world
            self._ends = (
                _End(*finder.nearest(world.counts.node, self._q_start), self._joins),
                _End(*finder.nearest(world.counts.node, self._q_goal), lambda q: finder.checker.segment(world.cells, q, self._q_goal)),
            )
        return self._ends

    def _search_connected(self) -> I32 | None:
        """Neurons of the best path whose two connections are free; None if there is none.

        The first search takes all connections for free. Where it uses one that is not, that end's connections are checked, nearest
        first, until some are free, and the search is repeated with those: three searches at the most.
        """
        neurons_rad = self._finder.roadmap.neurons_rad
        start, goal = ends = self._both_ends()
        for _ in range(3):
            neurons = self._finder.search(
                self._world.counts.node, self._edge_count, start.index, start.cost, goal.index, goal.cost, self._q_goal, self._search
            )
            if neurons is None:
                return None
            bad = [end for end, used in zip(ends, (neurons[0], neurons[-1]), strict=True) if not end.holds(used, neurons_rad)]
            if not bad:
                return neurons
            for end in bad:
                end.settle(neurons_rad)
        return None
