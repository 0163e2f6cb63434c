"""The map as something to search: nearest neurons, the best way between some of them, corners cut."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from services.planner.core.check import Checker
from services.planner.core.found import FoundPath, NotFound, path_length
from services.planner.core.roadmap import Roadmap
from services.planner.core.world import World
from services.planner.kernels.bidirectional import both_ends
from services.planner.kernels.path import nearest_free
from services.planner.kernels.search import NOT_FOUND, best_first, breadth_first

__all__ = ["N_CONNECTIONS", "SEARCHES", "PathFinder", "Rules"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
Rules = Literal["checked", "paper"]
SEARCHES = ("dijkstra", "astar", "bidirectional", "wavefront")  # the first three find equally short paths, the last the fewest neurons
N_CONNECTIONS = 24  # nearest free neurons that start and goal may join; our choice


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
        segments are tried. The piece that leads out of tolerated cells stays as it is.
        """
        path = found.q_rad
        kept = [0] if found.leaving is None else [0, 1]
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
