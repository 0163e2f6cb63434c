"""One question on the map by checked rules, which may be asked again.

The true start and goal join the map by checked connections to the nearest free neurons (:mod:`services.planner.kernels.connect`). The map's
edges are checked at the table's samples and connections at theirs, so a finer look at the answer may still find a touch between them. The
map is not at its end then: that piece is banned and the search goes on without it. Only where the map as it was built has no way is what
it has learned since asked too.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from services.planner.core.find import Counts, PathFinder
from services.planner.core.found import FoundPath, NotFound
from services.planner.core.world import Leaving, World
from services.planner.kernels.connect import BARRED, DIRECT, FOUND, FREE_CONNECTIONS, GOAL, JOINS, NO_WAY, START, ask_map

__all__ = ["Route"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]


class Route:
    """A question whose ends are free.

    Args:
        finder: the map.
        world: what the path is found in; without the tolerated cells if the arm leaves some.
        leaving: the cells that the arm stands among and must move away from; None: it stands free.
        q_start, q_goal: (J,) rad.
        search: one of :data:`services.planner.core.find.SEARCHES`.
    """

    def __init__(self, finder: PathFinder, world: World, leaving: Leaving | None, q_start: F64, q_goal: F64, search: str) -> None:
        self._finder, self._world, self._leaving = finder, world, leaving
        self._q_start, self._q_goal, self._search = q_start, q_goal, search
        self._counts: Counts = (world.counts.node, world.counts.edge)
        self._as_built = finder.roadmap.has_learned
        if self._as_built:
            self._counts = finder.as_built(self._counts)
        self._banned: list[int] = []
        self._try_direct = True
        self._ends = finder.new_ends()
        self._joined = False
        self._next: FoundPath | NotFound | None = None

    @staticmethod
    def ask(finder: PathFinder, world: World, q_start: F64, q_goal: F64, search: str) -> tuple[Route, int, int, int]:
        """A question of which it is not known whether its ends are free; asked at once, in one call.

        Returns:
            The route, what came of it (:mod:`services.planner.kernels.connect`), verdict and index of what blocks an end.
        """
        route = Route(finder, world, None, q_start, q_goal, search)
        status, n, verdict, index = ask_map(*finder.question(world, route._counts, q_start, q_goal, search), route._ends, finder.scratch)
        if status == DIRECT:
            route._next = route._found(np.empty(0, dtype=np.int32))
        else:
            route._try_direct, route._joined = False, True
            if status == FOUND:
                route._next = route._found(finder.scratch.path[:n].copy())
            elif status == NO_WAY:  # an end that is blocked is no question for what was learned
                route._next = route._by_learned()
        return route, status, verdict, index

    def find(self) -> FoundPath | NotFound:
        """The best path of those not banned."""
        if self._next is not None:
            found, self._next = self._next, None
            return found
        if self._try_direct and self._joins(self._q_goal):
            return self._found(np.empty(0, dtype=np.int32))
        self._try_direct = False
        self._join()
        neurons = self._connect()
        return self._by_learned() if neurons is None else self._found(neurons)

    def _by_learned(self) -> FoundPath | NotFound:
        """The best path that may use what was learned, once there is none without."""
        neurons = None
        if self._as_built:
            counts = self._world.counts
            self._counts, self._as_built, self._joined = (counts.node, counts.edge.copy()), False, False
            np.add.at(self._counts[1], self._banned, 1)
            self._join()
            neurons = self._connect()
        return NotFound("no_path", self._finder.no_way(self._world)) if neurons is None else self._found(neurons)

    def _connect(self) -> I32 | None:
        return self._finder.connect(self._world, self._counts, self._q_start, self._q_goal, self._search, self._ends)

    def ban(self, found: FoundPath, piece: int) -> None:
        """Never again use the straight piece from ``found.q_rad[piece]`` to the next point."""
        if len(found.neurons) == 0:
            self._try_direct = False
        elif piece <= 0:
            self._bar(START, found.neurons[0])
        elif piece >= len(found.neurons):
            self._bar(GOAL, found.neurons[-1])
        else:
            node, edge = self._counts
            if edge is self._world.counts.edge:
                self._counts = (node, edge.copy())
            self._banned.append(self._finder.roadmap.edge_between(found.neurons[piece - 1], found.neurons[piece]))
            self._counts[1][self._banned[-1]] += 1

    def _bar(self, end: int, neuron: int) -> None:
        at = self._ends.neuron[end] == neuron
        self._ends.known[end][at], self._ends.cost[end][at] = BARRED, np.inf

    def _found(self, neurons: I32) -> FoundPath:
        raw = np.empty((len(neurons) + 2, len(self._q_start)))
        raw[0], raw[1:-1], raw[-1] = self._q_start, self._finder.roadmap.neurons_rad[neurons], self._q_goal
        return FoundPath(neurons, raw, self._leaving)

    def _joins(self, q: F64) -> bool:
        """Whether the straight way from the start is free and, for an arm that stands among cells, leads out of them."""
        checker, leaving = self._finder.checker, self._leaving
        free = checker.segment(self._world.cells, self._q_start, q)
        return free and (leaving is None or leaving.is_way_out(checker, self._q_start, q))

    def _join(self) -> None:
        """Both ends' nearest free neurons; for an arm that stands among cells only such as lead out of them."""
        if self._joined:
            return
        self._joined = True
        self._finder.join(self._counts[0], self._q_start, self._q_goal, self._ends)
        if self._leaving is None:
            return
        n_free = 0
        for k in range(int(self._ends.n[START])):
            usable = n_free < FREE_CONNECTIONS and self._joins(self._finder.roadmap.neurons_rad[self._ends.neuron[START, k]])
            n_free += usable
            self._ends.known[START, k] = JOINS if usable else BARRED
            if not usable:
                self._ends.cost[START, k] = np.inf
