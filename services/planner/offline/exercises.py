"""What a map is asked when it practises: starts and goals of its training motions among other things than they were made for.

An exercise is drawn from one seed and its number, so that it does not depend on what was practised before it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.planner.offline.motions import MotionMaker
from services.planner.offline.problem_motions import ProblemMotionMaker
from services.planner.offline.solid_cells import solid_cells

__all__ = ["Exercise", "Exercises", "exercises_among_boxes", "exercises_of_problems"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Exercise:
    """Start and goal (J,) rad, and the occupied cells (C,)."""

    q_start: F64
    q_goal: F64
    cells: I32


Exercises = Callable[[int], Exercise | None]  # by number; None: that draw gave none


def exercises_among_boxes(maker: MotionMaker, paths: Sequence[F64], seed: int) -> Exercises:
    """The ends of one of ``paths`` (P, J) after the other, with new random boxes on the way, as ``maker`` strews them."""

    def exercise(number: int) -> Exercise | None:
        path = paths[number % len(paths)]
        cells = maker.clutter(path[0], path[-1], np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number,))))
        return Exercise(path[0], path[-1], cells) if len(cells) else None

    return exercise


def exercises_of_problems(maker: ProblemMotionMaker, seed: int) -> Exercises:
    """One training problem after the other, its scene moved at random, as cells."""

    def exercise(number: int) -> Exercise | None:
        moved = maker.moved(number, np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number,))))
        return None if moved is None else Exercise(moved.q_start, moved.q_goal, solid_cells(maker.scene.grid, moved.solids))

    return exercise
