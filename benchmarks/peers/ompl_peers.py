"""PRM, RRT, RRTConnect and BIT* of OMPL (wheel ``ompl``, 2.0.1) in full joint space, with coal as their collision checker.

How they are treated, so that nobody can say they were starved (figures: 20 to 30 questions of the set ``task`` of another seed):

* Each pose is one call into C++ (:mod:`benchmarks.peers.coal_world`); what Python adds to OMPL's call of it is about 1 us of 10 us.
* A motion is checked every 0.03 rad, Euclidean in joint space: ``setStateValidityCheckingResolution`` takes that as a share of the space's
  extent (15.4 rad for six joints of one turn each, so 0.0019; OMPL's default of 0.01 would be a pose every 0.15 rad).
* Ranges and batches are those that answered fastest of the ones tried, see ``PLANNERS``.
* BIT* is anytime: like the others it stops at its first path, which is then simplified.
* Simplified means OMPL's own ``PathSimplifier.simplify`` (shortcuts, fewer corners, B-spline, as in ``simplifySolution``), as long as it
  takes within what is left of the time limit: 45 ms, length 11.8 -> 6.8 rad. (100 partial shortcuts alone: 35 ms and as short; its
  default number of them: 6 ms, 8.3 rad.) What it calls invalid itself is not used: the raw path is the answer then.

Seeds: OMPL has one generator that hands a seed to each new sampler. It is seeded before each question and all samplers of a question are
new, so that equal seeds give equal paths as long as no time limit cuts in; of PRM not even then, as it grows by wall-clock time.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from ompl import base, geometric, util

from benchmarks.peers.coal_world import CoalArm, CoalWorld
from benchmarks.peers.peer import STEP_RAD, TIME_LIMIT_S, PeerAnswer, Setting, Watch
from benchmarks.questions import Question

__all__ = ["PLANNERS", "OmplPeer", "make"]

F64 = NDArray[np.float64]


def _prm(space: base.SpaceInformation) -> base.Planner:
    """As it comes: 10 neighbours; 5 and 20 are no faster (p50 22 ms)."""
    return geometric.PRM(space)


def _rrt(space: base.SpaceInformation) -> base.Planner:
    """Tried (range in rad, goal bias): 0.6, 1, 2, 4 with 0.05, 0.1 or 0.2: p50 24 .. 77 ms, all of 40 solved in 1 s only with these."""
    planner = geometric.RRT(space)
    planner.setRange(2.0)
    planner.setGoalBias(0.1)
    return planner


def _rrt_connect(space: base.SpaceInformation) -> base.Planner:
    """Tried: 0.3, 0.5, 0.75, 1, 1.5, 2, 3, 5 rad and OMPL's default of 3.1; p50 14 .. 8 .. 10 ms, p95 shortest at 2."""
    planner = geometric.RRTConnect(space)
    planner.setRange(2.0)
    return planner


def _bit_star(space: base.SpaceInformation) -> base.Planner:
    """Tried: batches of 20, 50, 100 (default), 200, 500: p50 7, 6, 8, 16, 25 ms; a radius for neighbours 11 ms, rewire factor 2 8 ms."""
    planner = geometric.BITstar(space)
    planner.setSamplesPerBatch(50)
    return planner


PLANNERS: dict[str, Callable[[base.SpaceInformation], base.Planner]] = {
    "ompl_prm": _prm,
    "ompl_rrt": _rrt,
    "ompl_rrt_connect": _rrt_connect,
    "ompl_bit_star": _bit_star,
}


class OmplPeer:
    """One of ``PLANNERS``. Holds what is made once per arm, one question at a time."""

    def __init__(self, name: str, setting: Setting) -> None:
        self.name = name
        self._setting = setting
        self._arm: CoalArm | None = None

    def prepare(self) -> None:
        """Convex pieces, static layer, joint space."""
        util.setLogLevel(util.LogLevel.LOG_NONE)
        self._arm = CoalArm(self._setting)
        low, high = self._setting.robot.position_min_rad, self._setting.robot.position_max_rad
        bounds = base.RealVectorBounds(len(low))
        for j in range(len(low)):
            bounds.setLow(j, float(low[j]))
            bounds.setHigh(j, float(high[j]))
        self._space = base.RealVectorStateSpace(len(low))
        self._space.setBounds(bounds)

    def solve(self, question: Question, time_limit_s: float = TIME_LIMIT_S, seed: int = 0, simplify: bool = True) -> PeerAnswer:
        """See :class:`benchmarks.peers.peer.Peer`."""
        if self._arm is None:
            self.prepare()
        assert self._arm is not None
        util.RNG.setSeed(seed + 1)  # 0 would mean: none
        watch = Watch()
        world = self._arm.world(question.cells)
        watch.lap("world")
        for end, q in (("start", question.q_start), ("goal", question.q_goal)):
            if not world.is_free(q):
                return PeerAnswer(None, None, watch.seconds(), f"the {end} is not free")
        problem = self._problem(world, question)
        path = _plan(PLANNERS[self.name], problem, time_limit_s)
        planned_s = watch.lap("plan")
        if path is None:
            return PeerAnswer(None, None, watch.seconds(), f"no path in {time_limit_s:g} s")
        raw = self._corners(path)
        answer = raw
        if simplify:
            simplifier = geometric.PathSimplifier(problem.getSpaceInformation())
            if simplifier.simplify(path, max(0.0, time_limit_s - planned_s), True):
                answer = self._corners(path)
            watch.lap("simplify")
        return PeerAnswer(answer, raw, watch.seconds())

    def _problem(self, world: CoalWorld, question: Question) -> base.ProblemDefinition:
        space = base.SpaceInformation(self._space)
        space.setStateValidityChecker(_checker(world, self._space.getDimension()))
        space.setStateValidityCheckingResolution(STEP_RAD / self._space.getMaximumExtent())
        space.setup()
        problem = base.ProblemDefinition(space)
        problem.setStartAndGoalStates(self._state(question.q_start), self._state(question.q_goal))
        objective = base.PathLengthOptimizationObjective(space)
        objective.setCostThreshold(base.Cost(float("inf")))  # the first path will do
        problem.setOptimizationObjective(objective)
        return problem

    def _state(self, q_rad: F64) -> base.State:
        state = self._space.allocState()
        state[0 : len(q_rad)] = [float(value) for value in q_rad]
        return state

    def _corners(self, path: geometric.PathGeometric) -> F64:
        n_joints = self._space.getDimension()
        return np.array([state[0:n_joints] for state in path.getStates()])


def _checker(world: CoalWorld, n_joints: int) -> Callable[[Any], bool]:
    q = np.empty(n_joints)
    joints = range(n_joints)

    def is_valid(state: Any) -> bool:
        q[:] = [state[j] for j in joints]
        return world.is_free(q)

    return is_valid


def _plan(
    make: Callable[[base.SpaceInformation], base.Planner], problem: base.ProblemDefinition, time_limit_s: float
) -> geometric.PathGeometric | None:
    planner = make(problem.getSpaceInformation())
    planner.setProblemDefinition(problem)
    planner.setup()
    planner.solve(base.timedPlannerTerminationCondition(time_limit_s))
    return problem.getSolutionPath() if problem.hasExactSolution() else None


def make(name: str, setting: Setting) -> OmplPeer:
    """The peer called ``name``, one of ``PLANNERS``."""
    assert name in PLANNERS
    return OmplPeer(name, setting)
