"""Which questions are put to other processes too."""

from __future__ import annotations

import numpy as np

from benchmarks.answers import Answer
from benchmarks.equal_answers import MOST_OPEN, N_EQUAL, to_repeat
from benchmarks.questions import Question
from common.robot.trajectory import JointTrajectory
from services.planner.core.found import FoundPath, NotFound
from services.planner.core.motion import Motion


def _questions(n: int) -> list[Question]:
    none = np.empty(0)
    return [Question(k, none, none, none, np.empty(0, dtype=np.int32)) for k in range(n)]


def _answers(is_open: list[bool]) -> list[Answer]:
    still = np.zeros((1, 6))
    motion = Motion(JointTrajectory(np.zeros(1), still, still), FoundPath(np.empty(0, dtype=np.int32), np.zeros((2, 6))), "straight", False)
    found, open_one = Answer(motion, {}), Answer(NotFound("no_path", ""), {})
    return [open_one if o else found for o in is_open]


def test_the_first_hundred_are_repeated_with_few_that_are_open() -> None:
    questions, answers = to_repeat(_questions(300), _answers([k % 2 == 0 for k in range(300)]))
    assert len(questions) == len(answers) == N_EQUAL
    assert [q.index for q in questions[:6]] == [0, 1, 2, 3, 5, 7]
    assert sum(a.way is None for a in answers) == MOST_OPEN


def test_fewer_questions_are_all_repeated() -> None:
    questions, answers = to_repeat(_questions(3), _answers([False, True, False]))
    assert [q.index for q in questions] == [0, 1, 2] and [a.way is None for a in answers] == [False, True, False]
