"""Where the search on the map found nothing: more connections, then bounded searches that join the parts of the map (repair)."""

from __future__ import annotations

from concurrent.futures import Executor

import numpy as np
from numpy.typing import NDArray

from services.planner.core.check import Checker
from services.planner.core.find import PathFinder
from services.planner.core.found import NO_NEURON, FoundPath
from services.planner.core.map_search import MapSearch
from services.planner.core.or_parallel import OrParallel
from services.planner.core.two_trees import FINER, Bounds, Joined, Known, seed_of
from services.planner.core.world import World
from services.planner.kernels.cells import Cells
from services.planner.kernels.shorten import cut_corners

__all__ = ["Repair", "tightened"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
U64 = NDArray[np.uint64]
PIECE_RAD = 0.25  # a path is cut into such pieces, so that corners can be cut anywhere; our choice
ROUNDS_ALONE = 4  # slices of the first search before the others join in; our choice: what is easy is over by then
CUTS, ROUNDS = 120, 2  # straight segments tried a round; our choice


def tightened(checker: Checker, cells: Cells, joined: Joined) -> Joined:
    """The path with its corners cut; what stays of it keeps its neurons. It needs no generator: equal paths get equal ones."""
    for _ in range(ROUNDS):
        joined = _corners_cut(checker, cells, joined)
    return joined


def _corners_cut(checker: Checker, cells: Cells, joined: Joined) -> Joined:
    q, neurons = _in_pieces(joined.q_rad, np.concatenate([[NO_NEURON], joined.neurons, [NO_NEURON]]).astype(np.int32))
    kept, proven = np.empty(len(q), dtype=np.int64), np.empty(len(q), dtype=np.uint8)
    n = cut_corners(checker.arm, checker.solids, cells, checker.safety_m, FINER * checker.step_m, q, 0, CUTS, kept, proven)
    return Joined(np.ascontiguousarray(q[kept[:n]]), neurons[kept[:n]][1:-1])


def _in_pieces(q: F64, neurons: I32) -> tuple[F64, I32]:
    points, names = [q[:1]], [neurons[:1]]
    for k in range(len(q) - 1):
        n = max(1, int(np.ceil(np.linalg.norm(q[k + 1] - q[k]) / PIECE_RAD)))
        share = (np.arange(1, n + 1) / n)[:, None]
        piece = q[k] + share * (q[k + 1] - q[k])
        piece[-1] = q[k + 1]
        points.append(piece)
        names.append(np.concatenate([np.full(n - 1, NO_NEURON), neurons[k + 1 : k + 2]]).astype(np.int32))
    return np.ascontiguousarray(np.vstack(points)), np.concatenate(names)


class Repair:
    """A question whose ends are free and which the map's own search did not answer; in slices.

    Args:
        finder: the map.
        world: what the path is found in.
        q_start: (J,) rad. q_goals: (G, J) rad, any of which will do.
        joint_range: (J,) least and largest joint angles.
        seed: (4,) the generator's state to begin with.
        bounds: of each search; with no iterations the map is only asked again, with more connections.
        n_searches: made side by side, on samples of their own.
        pool: see :class:`~services.planner.core.or_parallel.OrParallel`.
    """

    def __init__(
        self, finder: PathFinder, world: World, q_start: F64, q_goals: F64, joint_range: tuple[F64, F64],
        seed: U64, bounds: Bounds, n_searches: int, pool: Executor,
    ) -> None:  # fmt: skip
        self._finder, self._world = finder, world
        known = Known(finder.roadmap.graph, world.counts.node, world.counts.edge)
        states = [seed.copy(), *(seed_of(seed, np.array([0, k])) for k in range(1, n_searches))]  # none is a state of the fallback's
        question = (finder.checker, world.cells, known, q_start, q_goals, joint_range)
        self._searches = [MapSearch(*question, rng, bounds) for rng in states]
        self._side_by_side, self._pool = OrParallel(self._searches, pool, ROUNDS_ALONE), pool
        self._dropped = 0  # samples of searches that do not go on
        self._joined: Joined | None = None
        self._rounds = 0

    @property
    def iterations(self) -> int:
        """Samples of all searches so far."""
        return self._dropped + self._side_by_side.iterations

    def advance(self) -> FoundPath | bool:
        """One slice: a path, True while there is hope, False if there is none."""
        if self._joined is not None:
            return self._go_on(self._joined)
        if not self._side_by_side.advance():
            return True
        self._joined, self._rounds = self._side_by_side.found(), 0
        return self._joined is not None

    def _go_on(self, joined: Joined) -> FoundPath | bool:
        """With a way that was found: corners cut, a round a slice."""
        is_map = self._searches[0].is_of_the_map(joined)
        if not is_map and self._rounds < ROUNDS:
            self._joined, self._rounds = _corners_cut(self._finder.checker, self._world.cells, joined), self._rounds + 1
            return True
        return FoundPath(joined.neurons, joined.q_rad, way="map" if is_map else "repair")

    def alone(self) -> None:
        """One search goes on: that which has found a way, else the first."""
        one = self._side_by_side.winner() or self._searches[0]
        self._dropped += sum(search.iterations for search in self._searches if search is not one)
        self._searches = [one]
        self._side_by_side = OrParallel(self._searches, self._pool)

    def again(self) -> bool:
        """What found the way begins again with what is left of its bounds, on other samples, the others go on; False: nothing is left."""
        self._joined, winner = None, self._side_by_side.winner()
        has_more = winner is not None and winner.again()
        self._side_by_side = OrParallel(self._searches, self._pool)
        return has_more
