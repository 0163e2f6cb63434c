"""Whether a question can be answered at all: by RRTConnect in full joint space, under the very inflation that we plan with."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from benchmarks.questions import Question
from common.cell import load
from common.errors import TolmanError
from services.planner.assemble import Parts, assemble
from services.planner.config import PlannerConfig
from services.planner.core.arm import solids_of
from services.planner.core.rrt_connect import RrtConnect, RrtParameters
from services.planner.core.world import cells_of

__all__ = ["SOLVE_S", "are_solvable", "is_solvable"]

SOLVE_S = 5.0  # issue
N_WORKERS = 2  # issue: two cores
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


_parts: list[Parts] = []  # of a worker, made once


def _begin(config_path: Path | None, overrides: Sequence[str]) -> None:
    cell, config = load(config_path, "planner", PlannerConfig, list(overrides))
    _parts[:] = [assemble(cell, config)]


def _one(question: Question) -> bool:
    return is_solvable(_parts[0], question)


def are_solvable(config_path: Path | None, overrides: Sequence[str], questions: Sequence[Question]) -> Iterator[bool]:
    """:func:`is_solvable` of each question, in order, by as many processes as the figures suppose cores; each has one to itself.

    Args:
        config_path, overrides: of the cell, as for :func:`common.cell.load`; the map must be there already.
        questions: of that cell.

    Raises:
        TolmanError: ``worker_lost``: a process was ended from outside.
    """
    if not questions:
        return
    try:
        with ProcessPoolExecutor(N_WORKERS, get_context("spawn"), initializer=_begin, initargs=(config_path, overrides)) as workers:
            yield from workers.map(_one, questions)
    except BrokenProcessPool:
        raise TolmanError("a process that proves which questions can be solved was ended; ask again", code="worker_lost") from None
