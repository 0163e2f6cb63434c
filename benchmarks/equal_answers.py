"""Whether other processes give the same answers: each begins from the config, loads the map itself, and is asked the same questions."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from benchmarks.answers import Answer, Answerer, fallback_of
from benchmarks.questions import Question
from common.cell import load
from common.errors import TolmanError
from services.planner.assemble import assemble
from services.planner.config import PlannerConfig
from services.planner.core.motion import Motion
from services.planner.rehearsal import rehearse

__all__ = ["are_equal_elsewhere", "to_repeat"]

N_EQUAL = 100  # answers that are made once more by each process; issue
MOST_OPEN = 2  # of them without an answer, each of which takes the fallback to its bound, some seconds; our choice
N_PROCESSES = 2  # besides the first; issue


def to_repeat(questions: Sequence[Question], answers: Sequence[Answer]) -> tuple[list[Question], list[Answer]]:
    """The first questions, and their answers, that others shall answer too; among them few that are open."""
    chosen: list[tuple[Question, Answer]] = []
    n_open = 0
    for question, answer in zip(questions, answers, strict=True):
        n_open += answer.way is None
        if len(chosen) < N_EQUAL and (answer.way is not None or n_open <= MOST_OPEN):
            chosen.append((question, answer))
    return [question for question, _ in chosen], [answer for _, answer in chosen]


def are_equal_elsewhere(
    config_path: Path | None, overrides: Sequence[str], questions: Sequence[Question], answers: Sequence[Answer]
) -> bool:
    """Whether processes of their own, one after the other, give the bytes of ``answers``, refined ones included.

    Args:
        config_path, overrides: of the cell, as for :func:`common.cell.load`; the map must be there already.
        questions, answers: that were given here.

    Raises:
        TolmanError: ``worker_lost``: a process was ended from outside.
    """
    here = _digest(answers)
    try:
        for _ in range(N_PROCESSES):
            with ProcessPoolExecutor(1, get_context("spawn")) as worker:
                if worker.submit(_digest_of_new_answers, config_path, list(overrides), list(questions)).result() != here:
                    return False
    except BrokenProcessPool:
        raise TolmanError("a process that answers the questions once more was ended; ask again", code="worker_lost") from None
    return True


def _digest_of_new_answers(config_path: Path | None, overrides: list[str], questions: list[Question]) -> str:
    cell, config = load(config_path, "planner", PlannerConfig, overrides)
    parts = assemble(cell, config)
    rehearse(parts, time.monotonic_ns)
    with fallback_of(parts) as sampler:
        answerer = Answerer(parts, sampler)
        return _digest([answerer.answer(question) for question in questions])


def _digest(answers: Sequence[Answer]) -> str:
    digest = hashlib.sha256()
    for motion in (motion for answer in answers for motion in (answer.motion, answer.refined)):
        if motion is None:
            continue
        if isinstance(motion, Motion):
            digest.update(motion.path.way.encode())
            for array in (motion.path.neurons, motion.path.q_rad, motion.curve.t_s, motion.curve.q_rad, motion.curve.dq_rad_s):
                digest.update(np.ascontiguousarray(array).tobytes())
        else:
            digest.update(motion.outcome.encode())
    return digest.hexdigest()
