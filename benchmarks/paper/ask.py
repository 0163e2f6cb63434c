"""One question to one map: how it is asked, what comes back, and what of it the referee looks at."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from benchmarks.questions import Question
from common.errors import RequestError
from services.planner.assemble import Parts
from services.planner.core.find import SEARCHES, PathFinder, Rules
from services.planner.core.found import FoundPath, NotFound
from services.planner.core.motion import Ask, Motion, MotionPlanner, Stopwatch
from services.planner.core.way_out import route_of
from services.planner.core.world import World

__all__ = ["ALGORITHMS", "RULES", "Answer", "Variant", "answer", "dense", "find", "variants"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
RULES: tuple[Rules, ...] = get_args(Rules)[::-1]  # the paper's first
ALGORITHMS = tuple(name for name in ("wavefront", "dijkstra", "astar", "bidirectional") if name in SEARCHES)
DENSE = 20  # points looked at between two knots of a timed curve; straight pieces are the curve then


@dataclass(frozen=True)
class Variant:
    """A way of planning: map, search, smoothed or not, whose rules."""

    model: str
    search: str
    smooth: bool
    rules: Rules

    @property
    def name(self) -> str:
        """For ``--only`` and raw rows."""
        return f"{self.model}-{self.search}-{'smoothed' if self.smooth else 'raw'}-{self.rules}"


def variants(models: tuple[str, ...], searches: tuple[str, ...] = ALGORITHMS, only: str = "") -> list[Variant]:
    """All ways of planning, the paper's rules first; ``only``: those whose name contains it.

    Raises:
        RequestError: no name contains it.
    """
    every = [Variant(m, s, smooth, rules) for rules in RULES for m in models for s in searches for smooth in (False, True)]
    found = [variant for variant in every if only in variant.name]
    if not found:
        raise RequestError(f"--only {only}: no row is called so; rows are called like {every[0].name}", code="unknown_row")
    return found


@dataclass(frozen=True, eq=False)
class Answer:
    """What came back.

    Attributes:
        solved: there is a motion; else ``outcome`` says why not.
        neurons: (N,) on the path that the search found.
        raw_rad: (P, J) that path, from the true start to the true goal.
        path_rad: (K, J) what the arm would drive, close enough together that straight pieces are the curve.
        length_rad: of what the arm would drive.
        fell_back: smoothing was asked for and the arm stops on its way all the same: by the paper's rules at each corner, as no smooth
            curve was taken; by ours where a corner could not be rounded.
        ms: milliseconds by stage; ``path`` is update and search, ``total`` all.
    """

    solved: bool
    outcome: str
    neurons: I32
    raw_rad: F64
    path_rad: F64
    length_rad: float
    fell_back: bool
    ms: dict[str, float]


def answer(parts: Parts, planner: MotionPlanner, question: Question, variant: Variant) -> Answer:
    """Ask in a world that was empty until now: the cells of the question appear, then the answer is made."""
    counts = parts.roadmap.counts(parts.grid)
    watch = Stopwatch(time.perf_counter_ns)
    began = watch.clock_ns()
    counts.set_cells(question.cells)
    world = World.of(parts.grid, counts)
    watch.add("update", began)
    ask = Ask(question.q_start, question.q_goal, None, variant.rules, variant.search, variant.smooth)
    motion = planner.answer(world, ask, watch)
    watch.add("total", began)
    watch.ms["path"] = watch.ms["update"] + watch.ms.get("search", 0.0)
    if not isinstance(motion, Motion):
        nothing = np.empty((0, len(question.q_start)))
        return Answer(False, motion.outcome, np.empty(0, dtype=np.int32), nothing, nothing, float("nan"), False, watch.ms)
    driven = dense(motion) if variant.smooth else motion.path.q_rad
    return Answer(True, "solved", motion.path.neurons, motion.path.q_rad, driven, _length(driven), motion.fell_back, watch.ms)


def find(parts: Parts, finder: PathFinder, world: World, question: Question, rules: Rules, search: str) -> FoundPath | NotFound:
    """The search alone: the path joined to start and goal, as it is first found."""
    if rules == "paper":
        return finder.find_paper(world, question.q_start, question.q_goal, search)
    limits = (parts.robot.position_min_rad, parts.robot.position_max_rad)
    route = route_of(finder, world, question.q_start, question.q_goal, search, limits)
    return route if isinstance(route, NotFound) else route.find()


def dense(motion: Motion) -> Any:
    """(K, J) the curve itself, close enough together that straight pieces are the curve."""
    return motion.curve.sample(np.linspace(0.0, motion.curve.duration_s, DENSE * len(motion.curve.t_s)))[0]


def _length(path_rad: F64) -> float:
    return float(np.linalg.norm(np.diff(path_rad, axis=0), axis=1).sum())
