"""Whether a question can be answered at all: by RRTConnect in full joint space, under the very inflation that we plan with."""

from __future__ import annotations

import time

import numpy as np

from benchmarks.questions import Question
from services.planner.assemble import Parts
from services.planner.core.arm import solids_of
from services.planner.core.rrt_connect import RrtConnect, RrtParameters
from services.planner.core.world import cells_of

__all__ = ["SOLVE_S", "is_solvable"]

SOLVE_S = 5.0  # issue
ITERATIONS = 20_000  # a round of RRTConnect; rounds go on until the time is over


def is_solvable(parts: Parts, question: Question, limit_s: float = SOLVE_S) -> bool:
    """Whether RRTConnect solves it within ``limit_s``, by the check that our own paths pass."""
    rrt = RrtConnect(
        parts.checker().arm,
        solids_of(parts.cell.static),
        parts.robot.position_min_rad,
        parts.robot.position_max_rad,
        RrtParameters(max_iterations=ITERATIONS),
    )
    world = rrt.world(cells_of(parts.grid, question.cells), parts.config.margins.safety_m)
    state = np.random.SeedSequence(question.index).generate_state(4, np.uint64).astype(np.uint64)
    began = time.monotonic()
    while time.monotonic() - began < limit_s:
        if rrt.plan(world, question.q_start, question.q_goal, state) is not None:
            return True
    return False
