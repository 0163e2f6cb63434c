"""One problem of a file put to our planner, and what of it RRTConnect can solve: on its true shapes, and in the very cells we plan in."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.answers import Answerer
from benchmarks.exact import Exact, ExactPlanner
from benchmarks.questions import Question
from benchmarks.referee import Referee, at_steps
from services.planner.assemble import Parts
from services.planner.core.find import PathFinder
from services.planner.core.found import path_length
from services.planner.core.lookup import BlockedCounts
from services.planner.core.motion import Motion
from services.planner.core.rrt_connect import RrtConnect, RrtParameters
from services.planner.core.ways import Sampler
from services.planner.core.world import World, cells_of
from services.planner.kernels.collision import FREE
from services.planner.offline.problems import Problem
from services.planner.offline.solid_cells import solid_cells

__all__ = ["WAYS", "Record", "Solver"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
U64 = NDArray[np.uint64]
WAYS = ("map", "repair", "fallback")
ROUND = 2000  # samples of RRTConnect; rounds of new seeds go on until the limit; our choice
DENSE = 20  # points of a curve a knot: straight pieces between them are the curve


@dataclass(frozen=True)
class Record:
    """What became of one problem.

    Attributes:
        set_name, index: of the problem.
        exact: RRTConnect on the true shapes: solved, start_blocked, goal_blocked, unsolved.
        cells: the same in the cells that we plan in: solved (by RRTConnect, or by us), start_blocked, goal_blocked, unsolved.
        way: which of our ways answered; None: none did.
        map_says: found, or why the map had no answer: start_blocked, goal_blocked, start_apart, goal_apart, start_and_goal_apart (that
            end joins none of its nearest free neurons), cut (both join, but there is no way between, or no curve along it is free).
        ms: from cells to the answer, of the way that answered; without one, of all that was tried.
        length_rad, reference_rad: of our curve, and of RRTConnect's simplified path on the true shapes.
        collides: our curve, on the true shapes.
        n_cells: that the scene occupies.
    """

    set_name: str
    index: int
    exact: str
    cells: str
    way: str | None
    map_says: str
    ms: float
    length_rad: float | None
    reference_rad: float | None
    collides: bool
    n_cells: int

    @property
    def is_solvable_exact(self) -> bool:
        """RRTConnect solved it on the true shapes; or we did, and coal found nothing wrong with it there."""
        return self.exact == "solved" or (self.way is not None and not self.collides)

    @property
    def is_solvable_cells(self) -> bool:
        """RRTConnect or we solved it in the cells."""
        return self.cells == "solved"


class Solver:
    """Puts problems to one map. Holds scratch: one per thread.

    Args:
        parts: map, robot, config.
        sample: asks the fallback; None: there is none.
        limit_s: of processor time that RRTConnect gets to show that a problem can be solved; so a busy machine changes little.
    """

    def __init__(self, parts: Parts, sample: Sampler | None, limit_s: float) -> None:
        self._parts, self._limit_s = parts, limit_s
        self._answerer = Answerer(parts, sample)
        self._finder = PathFinder(parts.roadmap, parts.checker())
        self._checker = self._finder.checker
        self._exact = ExactPlanner(parts.robot)
        low, high = parts.robot.position_min_rad, parts.robot.position_max_rad
        self._rrt = RrtConnect(self._checker.arm, self._checker.solids, low, high, RrtParameters(max_iterations=ROUND))

    def ask(self, problem: Problem) -> Record:
        """All that is to be known of one problem."""
        exact = self._exact.solve(problem, self._limit_s)
        cells = self._cells(problem)
        way, curve, says, ms = self._answer(problem, cells)
        return Record(
            set_name=problem.set_name,
            index=problem.index,
            exact=exact.outcome,
            cells="solved" if way is not None else self._in_cells(problem, cells),
            way=way,
            map_says=says,
            ms=round(ms, 3),
            length_rad=None if curve is None else path_length(curve),
            reference_rad=_length(exact),
            collides=curve is not None and self._collides(problem, curve),
            n_cells=len(cells),
        )

    def rehearse(self, problem: Problem) -> None:
        """Answer without a record: what is not yet compiled is then."""
        self._answer(problem, self._cells(problem))

    def _cells(self, problem: Problem) -> I32:
        """What the scene occupies, but for the cells about the shoulder that no pose avoids: the planner leaves them out too."""
        occupied = solid_cells(self._parts.grid, problem.solids)
        return np.setdiff1d(occupied, self._parts.roadmap.table.unavoidable, assume_unique=True)

    def _answer(self, problem: Problem, cells: I32) -> tuple[str | None, F64 | None, str, float]:
        """Way, points of the curve (K, J), what the map said, milliseconds from cells to the answer."""
        for end, q in (("start", problem.q_start), ("goal", problem.q_goal)):
            if self._parts.robot.limit_violation(q):
                return None, None, f"{end}_out_of_limits", 0.0
        asked = self._answerer.answer(Question(problem.index, problem.q_start, problem.q_goal, np.empty((0, 2, 3)), cells))
        ms, motion = asked.ms["answer"], asked.motion
        if isinstance(motion, Motion):
            return asked.way, _dense(motion), "found" if asked.way == "map" else self._why(problem, cells), ms
        return None, None, self._why(problem, cells) if motion.outcome == "no_path" else motion.outcome, ms

    def _why(self, problem: Problem, cells: I32) -> str:
        """Why the map alone has no answer, both ends being free."""
        roadmap = self._parts.roadmap
        counts = BlockedCounts(roadmap.table, roadmap.n_neurons, roadmap.n_edges)
        counts.set_cells(cells)
        world, ends = World.of(self._parts.grid, counts), self._finder.new_ends()
        self._finder.join(world.counts.node, problem.q_start, problem.q_goal, ends)
        apart = []
        for end, (name, q) in enumerate((("start", problem.q_start), ("goal", problem.q_goal))):
            near = ends.neuron[end, : ends.n[end]]
            if not any(self._checker.segment(world.cells, q, roadmap.neurons_rad[k]) for k in near):
                apart.append(name)
        return "cut" if not apart else f"{'_and_'.join(apart)}_apart"

    def _in_cells(self, problem: Problem, cells: I32) -> str:
        """What RRTConnect says in our cells, by our check."""
        arranged = cells_of(self._parts.grid, cells)
        for end, q in (("start", problem.q_start), ("goal", problem.q_goal)):
            if self._parts.robot.limit_violation(q) or self._checker.pose(arranged, q)[0] != FREE:
                return f"{end}_blocked"
        world, state = self._rrt.world(arranged, self._checker.safety_m), _seed(problem)
        began_s = time.thread_time()
        while time.thread_time() - began_s < self._limit_s:
            if self._rrt.plan(world, problem.q_start, problem.q_goal, state) is not None:
                return "solved"
        return "unsolved"

    def _collides(self, problem: Problem, curve: F64) -> bool:
        return Referee(self._parts.robot, list(problem.solids)).collides(at_steps(curve), np.empty((0, 2, 3)))


def _seed(problem: Problem) -> U64:
    return np.random.SeedSequence(problem.index).generate_state(4, np.uint64).astype(np.uint64)


def _dense(motion: Motion) -> Any:
    return motion.curve.sample(np.linspace(0.0, motion.curve.duration_s, DENSE * len(motion.curve.t_s)))[0]


def _length(exact: Exact) -> float | None:
    return None if exact.path_rad is None else path_length(exact.path_rad)
