"""What follows where the map has no way: the map again with more connections, repair, fallback. One question, in slices, pure.

The fallback runs elsewhere: :attr:`Thinking.wanted` is the question for it, :meth:`Thinking.hear` takes the answer. It is asked while
repair is still searching, so that it loses no time, and counts only if repair finds nothing: what is found depends on map, cells and
question alone; how long a slice or an answer takes changes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from services.planner.config import PlannerConfig
from services.planner.core.found import NO_NEURON, FoundPath, NotFound, Way
from services.planner.core.motion import Ask, Motion, MotionPlanner, Stopwatch
from services.planner.core.repair import Repair
from services.planner.core.two_trees import Bounds, Known, seed_of
from services.planner.core.world import World
from services.planner.kernels.collision import FREE

__all__ = ["Errand", "Sampler", "SamplingAnswer", "SamplingQuestion", "Thinking", "ThinkingRules", "think"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
U64 = NDArray[np.uint64]
# Samples of repair, of all its searches, before the fallback is asked; most is solved by then. From there on repair makes one search, since
# the fallback makes as many as there are cores: on two, four at once were late with what is hard (`wall` 53: 0.9 instead of 0.5 s).
HEAD_START = 1_000
TRIES = 3  # paths of each way until a curve along one is free; our choice: nearly always the first is


@dataclass(frozen=True)
class ThinkingRules:
    """Which ways there are besides the map, their bounds in samples, and how many searches each makes side by side."""

    ways: Sequence[Way]
    repair: Bounds
    fallback_iterations: int
    fallback_searches: int = 1
    repair_searches: int = 1

    @staticmethod
    def of(config: PlannerConfig) -> ThinkingRules:
        """As configured."""
        repair = config.repair
        bounds = Bounds(repair.iterations, repair.slice_iterations, connections=repair.connections)
        return ThinkingRules(config.ways, bounds, config.fallback.iterations, config.fallback.searches, repair.searches)


@dataclass(frozen=True, eq=False)
class SamplingQuestion:
    """For the fallback: start (J,) and goals (G, J) rad, cells (C,), the generator's state (4,), samples at most of each search.

    ``known``: the map, with what the cells block of it, for every second search; without it all are in the bare joint space.
    """

    q_start_rad: F64
    q_goals_rad: F64
    cells: I32
    seed: U64
    max_iterations: int
    n_searches: int = 1
    known: Known | None = None


@dataclass(frozen=True, eq=False)
class SamplingAnswer:
    """From the fallback: a way (P, J) rad or why there is none, samples and milliseconds of work."""

    q_rad: F64 | None
    why: str
    iterations: int
    ms: float


class Errand(Protocol):
    """A question that was put to the fallback."""

    def wait(self) -> SamplingAnswer:
        """The answer, once, in the end."""

    def withdraw(self) -> None:
        """It is not wanted any more."""


Sampler = Callable[[SamplingQuestion], Errand]


class Thinking:
    """One question in one world.

    Args:
        planner: makes motions of paths; its finder and checker are used.
        world: the cells that it is thought about in.
        ask: start, and how to drive; its goal counts for nothing.
        q_goals: (G, J) rad, any of which will do.
        rules: ways and bounds.
        why: what the map's own search said.

    Attributes:
        world: see above.
        wanted: the question for the fallback, as long as it is not answered.
        way: which way is tried now.
        is_stale: a way was found, but other cells than those of ``world`` are there by now.
    """

    def __init__(self, planner: MotionPlanner, world: World, ask: Ask, q_goals: F64, rules: ThinkingRules, why: str) -> None:
        self.world = world
        self.wanted: SamplingQuestion | None = None
        self._planner, self._ask, self._rules, self._why = planner, ask, rules, [why]
        self._q_goals = np.array([q for q in q_goals if planner.checker.pose(world.cells, q)[0] == FREE]).reshape(-1, len(ask.q_start))
        self._seed = seed_of(world.counts.cells, ask.q_start, self._q_goals)
        self._is_start_free = planner.checker.pose(world.cells, ask.q_start)[0] == FREE
        self._answer: SamplingAnswer | None = None
        self._tries = 0
        self._is_asked = False
        self.is_stale = False
        self.way: Way = "repair" if "repair" in rules.ways else "map"
        bounds = rules.repair if self.way == "repair" else replace(rules.repair, iterations=0)
        question = (planner.finder, world, ask.q_start, self._q_goals, planner.joint_range)
        self._repair = Repair(*question, self._seed, bounds, rules.repair_searches if self.way == "repair" else 1, planner.pool)

    @property
    def is_waiting(self) -> bool:
        """Whether nothing can be done until the fallback has answered."""
        return self.way == "fallback" and self.wanted is not None

    def hear(self, answer: SamplingAnswer) -> None:
        """The fallback's answer to the question that was :attr:`wanted`."""
        self.wanted, self._answer = None, answer

    def advance(self, world: World, watch: Stopwatch) -> Motion | NotFound | None:
        """One slice; a motion that is free in ``world``, the cells of now, or why there is none, or None: not yet."""
        if len(self._q_goals) == 0 or not self._is_start_free:
            return self._nothing()
        return self._by_fallback(world, watch) if self.way == "fallback" else self._by_repair(world, watch)

    def _by_repair(self, world: World, watch: Stopwatch) -> Motion | NotFound | None:
        began = watch.clock_ns()
        found = self._repair.advance()
        watch.add("repair", began)
        if isinstance(found, bool):
            if self._repair.iterations >= HEAD_START and "fallback" in self._rules.ways and not self._is_asked:
                self._want()
                self._repair.alone()
            return None if found else self._after_repair()
        motion = self._drive(world, found, watch)
        if motion is None and (self._tries == TRIES or not self._repair.again()):
            return self._after_repair()
        return motion

    def _by_fallback(self, world: World, watch: Stopwatch) -> Motion | NotFound | None:
        answer, self._answer = self._answer, None
        if answer is None:
            return None
        watch.ms["fallback"] = watch.ms.get("fallback", 0.0) + answer.ms
        if answer.q_rad is None:
            self._why.append(answer.why)
            return self._nothing()
        neurons = np.full(len(answer.q_rad) - 2, NO_NEURON, dtype=np.int32)
        motion = self._drive(world, FoundPath(neurons, answer.q_rad, way="fallback"), watch)
        if motion is None and self._tries == TRIES:
            return self._nothing()
        if motion is None:
            self._want()
        return motion

    def _drive(self, world: World, found: FoundPath, watch: Stopwatch) -> Motion | None:
        self._tries += 1
        self.is_stale = not np.array_equal(world.counts.cells, self.world.counts.cells)
        motion = self._planner.along(world, replace(self._ask, q_goal=found.q_rad[-1]), found, watch)
        if motion is not None and self.is_stale and self._planner.checker.curve(world.cells, motion.curve)[0] != FREE:
            motion = None  # a path's first and last piece count as free where it was found: here they need not be
        if motion is None and self._tries == TRIES:
            self._why.append(f"no curve along the way of the {found.way} is free")
        return motion

    def _after_repair(self) -> NotFound | None:
        if self.way == "repair":
            self._why.append(f"repair found no way in {self._repair.iterations} samples")
        if "fallback" not in self._rules.ways:
            return self._nothing()
        self.way, self._tries = "fallback", 0
        if not self._is_asked:
            self._want()
        return None

    def _want(self) -> None:
        self._is_asked = True
        tries = self._tries if self.way == "fallback" else 0
        seed = seed_of(self._seed, np.array([tries]))  # other samples than those of repair, and others each time
        rules, counts = self._rules, self.world.counts
        known = Known(self._planner.finder.roadmap.graph, counts.node.copy(), counts.edge.copy())  # it is packed later, elsewhere
        ends = (self._ask.q_start, self._q_goals)
        self.wanted = SamplingQuestion(*ends, counts.cells, seed, rules.fallback_iterations, rules.fallback_searches, known)

    def _nothing(self) -> NotFound:
        return NotFound("no_path", "; ".join(self._why))


def think(thinking: Thinking, world: World, watch: Stopwatch, sampler: Sampler | None) -> Motion | NotFound:
    """The whole of it at once, waiting where there is nothing else to do; without ``sampler`` the fallback must not be among its ways."""
    asked: SamplingQuestion | None = None
    errand: Errand | None = None
    while (outcome := thinking.advance(world, watch)) is None:
        if sampler is not None and thinking.wanted is not None and thinking.wanted is not asked:
            asked = thinking.wanted
            errand = sampler(asked)
        if thinking.is_waiting and errand is not None:
            thinking.hear(errand.wait())
    if errand is not None and thinking.wanted is not None:
        errand.withdraw()
    return outcome
