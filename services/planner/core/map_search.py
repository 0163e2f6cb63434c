"""A search by two trees on a map (:mod:`services.planner.core.two_trees`) that looks at the map's edges as closely as at the rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from services.planner.core.check import Checker
from services.planner.core.found import NO_NEURON
from services.planner.core.roadmap import edge_between
from services.planner.core.two_trees import Bounds, Joined, Known, TwoTrees
from services.planner.kernels.cells import Cells

__all__ = ["MapSearch"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
U64 = NDArray[np.uint64]
MAX_BANS = 40  # times that the search begins anew, until it is given up; our choice


class MapSearch:
    """The table says which edges are free; of a way that is found they are looked at once more.

    One that is blocked after all is banned, and the search begins again without it, on other samples.

    Args:
        checker: the one check.
        cells: occupied.
        known: the map.
        q_start: (J,) rad. q_goals: (G, J) rad; all free.
        joint_range: (J,) least and largest joint angles.
        rng: (4,) state of the generator; advanced.
        bounds: of all searches together.
    """

    def __init__(
        self, checker: Checker, cells: Cells, known: Known, q_start: F64, q_goals: F64, joint_range: tuple[F64, F64],
        rng: U64, bounds: Bounds,
    ) -> None:  # fmt: skip
        self._checker, self._cells = checker, cells
        self._known = known._replace(edge_count=known.edge_count.copy())
        self._question, self._rng, self._bounds = (q_start, q_goals, joint_range), rng, bounds
        self._iterations_before = 0
        self._bans = 0
        self._trees = self._begin()

    def _begin(self) -> TwoTrees:
        return TwoTrees(self._checker, self._cells, self._known, *self._question, self._rng, self._bounds)

    @property
    def iterations(self) -> int:
        """Samples so far."""
        return self._iterations_before + self._trees.iterations

    def advance(self) -> bool:
        """One slice; True when the search is over."""
        if not self._trees.advance():
            return False
        joined = self._trees.found()
        return joined is None or not self._ban_blocked(joined) or not self.again()

    def found(self) -> Joined | None:
        """The way, once the search is over; None: there is none within the bounds."""
        return self._trees.found()

    def again(self) -> bool:
        """Begin again with what is left of the bounds; False: nothing is left."""
        self._bans += 1
        self._iterations_before += self._trees.iterations
        self._bounds = self._bounds.less(self._trees.iterations)
        self._trees = self._begin()
        return self._bans <= MAX_BANS

    def is_of_the_map(self, joined: Joined) -> bool:
        """Whether the way uses the map's neurons and edges alone."""
        return (
            len(joined.neurons) > 0
            and all(self._edge_of(joined.neurons, piece) is not None for piece in range(1, len(joined.neurons)))
            and NO_NEURON not in joined.neurons
        )

    def _ban_blocked(self, joined: Joined) -> bool:
        q = joined.q_rad
        blocked = False
        for piece in range(1, len(joined.neurons)):
            edge = self._edge_of(joined.neurons, piece)
            if edge is not None and not self._checker.segment(self._cells, q[piece], q[piece + 1]):
                self._known.edge_count[edge] += 1
                blocked = True
        return blocked

    def _edge_of(self, neurons: I32, piece: int) -> int | None:
        """The map's edge that a piece is: from the point before neuron ``piece`` of the way to it."""
        if not 0 < piece < len(neurons) or NO_NEURON in (neurons[piece - 1], neurons[piece]):
            return None
        try:
            return edge_between(self._known.graph, int(neurons[piece - 1]), int(neurons[piece]))
        except KeyError:  # a straight way between two neurons that the search found
            return None
