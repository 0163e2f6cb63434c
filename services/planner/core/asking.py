"""Asking the motion planner for a goal that several joint vectors reach, and how long answers took lately."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from services.planner.config import PlannerConfig
from services.planner.core.check import HandReach
from services.planner.core.found import NotFound
from services.planner.core.motion import ROUTES, Ask, Motion, MotionPlanner, Stopwatch
from services.planner.core.world import World

__all__ = ["Asker"]

F64 = NDArray[np.float64]
MOVING_ROUTES = 2  # paths tried for a branch while the arm moves and cannot wait; the next attempt comes with the next frame; our choice
BUDGET_ANSWERS, BUDGET_ROOM, BUDGET_MAX_S = 8, 1.3, 0.2  # answers that the splice budget follows, room on top, and its end; our choice


class Asker:
    """Tries a goal's branches a few at a time, so that no step takes long; the next attempt goes on with others."""

    def __init__(self, planner: MotionPlanner, config: PlannerConfig, clock_ns: Callable[[], int]) -> None:
        self._planner = planner
        self._config = config
        self._clock_ns = clock_ns
        self._recent_answers_s: deque[float] = deque(maxlen=BUDGET_ANSWERS)
        self._next_branch = 0

    def rearm(self, planner: MotionPlanner) -> None:
        """Ask another planner from now on."""
        self._planner = planner

    def begin(self) -> None:
        """There is a new goal: the nearest branches come first."""
        self._next_branch = 0

    @property
    def budget_s(self) -> float:
        """How much later than now a new motion may take over: what answers took lately, with room, and never less than configured."""
        return min(max(self._config.replan.splice_budget_s, BUDGET_ROOM * self.longest_s), BUDGET_MAX_S)

    @property
    def longest_s(self) -> float:
        """The longest of the last answers; zero before the first."""
        return max(self._recent_answers_s, default=0.0)

    def ask(
        self, world: World, branches_rad: F64, q: F64, dq: F64 | None, n_branches: int, speed_scale: float, hand: HandReach
    ) -> tuple[Motion | NotFound, F64, dict[str, float]]:
        """The first of some goal branches that has an answer; the first one's refusal if none has.

        The nearest branches come first. After an attempt without an answer the next one begins where that ended.

        Args:
            world: the live cells.
            branches_rad: (B, J) joint vectors that reach the goal.
            q, dq: (J,) where the motion begins, and its velocity there (None: at rest).
            n_branches: how many to try.
            speed_scale: of the goal.
            hand: what to expect of things that move.

        Returns:
            The answer, (J,) the branch that it is for, and milliseconds by stage.
        """
        watch = Stopwatch(self._clock_ns)
        began = self._clock_ns()
        near_first = branches_rad[np.argsort(np.linalg.norm(branches_rad - q, axis=1), kind="stable")]
        near_first = np.roll(near_first, -self._next_branch, axis=0)
        first: NotFound | None = None
        config = self._config
        routes = ROUTES if dq is None else MOVING_ROUTES
        for q_goal in near_first[:n_branches]:
            ask = Ask(q, q_goal, dq, config.rules, config.search, config.smoothing.smooth, speed_scale, routes, hand)
            answer = self._planner.answer(world, ask, watch)
            if isinstance(answer, Motion):
                break
            first = first or answer
        solved = isinstance(answer, Motion)
        self._next_branch = 0 if solved else (self._next_branch + n_branches) % len(near_first)
        watch.add("total", began)
        self._recent_answers_s.append(watch.ms["total"] / 1e3)
        if isinstance(answer, Motion) and dq is None:
            answer = self._planner.refined(world, ask, answer, watch)  # an arm that stands has the time
        return (answer if solved or first is None else first), q_goal, watch.ms
