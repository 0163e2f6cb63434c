"""One question on the map by checked rules.

The true start and goal join the map by connections to the nearest free neurons; a connection is checked when the search wants to use it
(most never are).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from services.planner.core.find import PathFinder
from services.planner.core.found import FoundPath, NotFound, path_length
from services.planner.core.world import Leaving, World

__all__ = ["Route"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
FREE_CONNECTIONS = 6  # free ones that are enough for an end whose first choice was blocked; our choice


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
