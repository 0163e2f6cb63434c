"""Thinks about the goal of an arm that stands, while the map has no way to it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.geometry.grid import Grid
from services.planner.core.found import NotFound
from services.planner.core.motion import Ask, Motion, MotionPlanner, Stopwatch
from services.planner.core.vision import PATCH_CELLS
from services.planner.core.ways import SamplingAnswer, SamplingQuestion, Thinking, ThinkingRules
from services.planner.core.world import World
from services.planner.kernels.neighbours import in_patches

__all__ = ["Thinker"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
RESTARTS = 3  # in a row; then it is thought to the end, else a hand that waves would never let it; our choice


class Thinker:
    """Holds what is being thought about, and what was thought through in vain.

    Cells that flicker change nothing. A patch of cells that came or went lets it begin anew, a few times in a row; whatever is found is
    checked on the cells of the moment, and where they are others than those it was found in and it is not free, it begins anew too.

    Args:
        planner: makes motions of paths.
        rules: ways and bounds.
        grid: the cells'.

    Attributes:
        ms: milliseconds by stage that the present goal has cost here.
    """

    def __init__(self, planner: MotionPlanner, rules: ThinkingRules, grid: Grid) -> None:
        self._planner, self._rules, self._grid = planner, rules, grid
        self._marked = np.zeros(grid.n_cells, dtype=np.uint8)
        self.drop()

    @property
    def question(self) -> SamplingQuestion | None:
        """For the fallback, until it is answered."""
        return self._thinking.wanted if self._thinking is not None else None

    @property
    def is_thinking(self) -> bool:
        """Whether an answer may still come."""
        return self._thinking is not None

    @property
    def wants_steps(self) -> bool:
        """Whether there is work to be done here and now."""
        return self._thinking is not None and not self._thinking.is_waiting

    @property
    def word(self) -> str:
        """What is being done, for the status."""
        return "" if self._thinking is None else f"{self._thinking.way} is searching"

    def is_about(self, goal_id: str, q_start: F64) -> bool:
        """Whether that goal is thought about, from there (J,)."""
        return self._about == (goal_id, q_start.tobytes())

    def hear(self, question: SamplingQuestion, answer: SamplingAnswer) -> None:
        """The fallback's answer; one to a question of before is of no use."""
        if self._thinking is not None and self._thinking.wanted is question:
            self._thinking.hear(answer)

    def rearm(self, planner: MotionPlanner) -> None:
        """The arm is another one: what was thought of the one before is of no use."""
        self._planner = planner
        self.drop()

    def drop(self) -> None:
        """There is a way, another goal, or none."""
        self._thinking: Thinking | None = None
        self.ms: dict[str, float] = {}
        self._about: tuple[str, bytes] | None = None
        self._cells: I32 = np.empty(0, dtype=np.int32)
        self._restarts = 0
        self._in_vain: NotFound | None = None
        self._asked: tuple[F64, Ask, NotFound] | None = None

    def consider(self, goal_id: str, q_goals: F64, ask: Ask, world: World, why: NotFound) -> NotFound:
        """The map has just found no way: begin to think, or go on; what there is to say of it.

        Args:
            goal_id, q_goals: what for; (G, J) rad.
            ask: start, and how to drive.
            world: the cells of now.
            why: the map's word.
        """
        about = (goal_id, ask.q_start.tobytes())
        self._asked = (q_goals, ask, why)
        if about != self._about:
            self.drop()
            self._about, self._asked = about, (q_goals, ask, why)
            self._begin(world)
        elif self._matters(world) and (self._thinking is None or self._restarts < RESTARTS):
            self._restarts = 0 if self._thinking is None else self._restarts + 1
            self._begin(world)
        return self._in_vain or why

    def advance(self, world: World, watch: Stopwatch) -> Motion | NotFound | None:
        """One slice: a motion that is free in ``world``, the cells of now, or that there is none, or None: not yet."""
        thinking = self._thinking
        assert thinking is not None
        outcome = thinking.advance(world, watch)
        if isinstance(outcome, Motion):
            return outcome
        if thinking.is_stale:
            self._begin(world)
            return None
        if outcome is not None:
            self._thinking, self._in_vain, self._restarts = None, outcome, 0
        return outcome

    def _begin(self, world: World) -> None:
        assert self._asked is not None
        q_goals, ask, why = self._asked
        self._cells, self._in_vain = world.counts.cells, None
        self._thinking = Thinking(self._planner, world.frozen(), ask, q_goals, self._rules, why.reason)

    def _matters(self, world: World) -> bool:
        """Whether a patch of cells came or went since it began."""
        changed = np.setxor1d(world.counts.cells, self._cells, assume_unique=True).astype(np.int32)
        keep = np.empty(len(changed), dtype=np.bool_)
        in_patches(changed, self._grid.shape, PATCH_CELLS, self._marked, keep)
        return bool(keep.any())
