"""What repair and fallback solved joins the map: does the map then answer such questions alone, and are its old answers as good as before?

Learned are questions that the map alone did not answer. Each is asked again with start and goal moved by up to 0.1 rad, among the same
cells. The old questions are those of the set ``task`` that the map alone answered before.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.progress import track

from benchmarks.answers import Answerer, fallback_of
from benchmarks.provenance import provenance
from benchmarks.questions import SETS, Question, questions
from common.cell import load
from common.config import plain
from common.errors import RequestError
from services.planner.assemble import Parts, assemble
from services.planner.config import PlannerConfig
from services.planner.core.motion import Motion
from services.planner.core.world import cells_of
from services.planner.kernels.collision import FREE
from services.planner.learner import Lesson, Student
from services.planner.memory import Memory
from services.planner.rehearsal import rehearse

__all__ = ["add_arguments", "run"]

F64 = NDArray[np.float64]
MOVED_RAD = 0.1  # issue: Euclidean, start and goal each
MOVES = 3  # of each learned question
DRAWS = 100  # until a moved pose is free


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which questions are learned, how many old ones are compared, and where the figures go."""
    parser.add_argument("--set", dest="name", default="task", choices=SETS, help="questions that are learned (default %(default)s)")
    parser.add_argument("--n", type=int, default=500, help="questions looked through for those to learn (default %(default)s)")
    parser.add_argument("--old", type=int, default=500, help="old questions asked again (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path, default=None, metavar="FILE")
    parser.add_argument("--config", type=Path, default=None, metavar="FILE", help="cell config; default: the UR3 cell")
    parser.add_argument("--override", action="append", default=[], metavar="KEY=VALUE", help="as --set elsewhere: planner.search=astar")


def run(args: argparse.Namespace) -> int:
    """Solve, learn, ask again, compare, print, write."""
    for name, n in (("--n", args.n), ("--old", args.old)):
        if n < 1:
            raise RequestError(f"{name} {n}: at least one question is needed", code="out_of_range")
    cell, config = load(args.config, "planner", PlannerConfig, args.override)
    parts = assemble(cell, config)
    rehearse(parts, time.monotonic_ns)
    before = Answerer(parts, None, ways=("map",))
    old = [(q, before.answer(q)) for q in track(list(questions(parts, "task", args.old, args.seed)), "old questions", transient=True)]
    old = [(question, answer) for question, answer in old if answer.way == "map"]
    solved = _solved(parts, before, list(questions(parts, args.name, args.n, args.seed)))
    grown, refused = _learn(parts, solved)
    after = Answerer(grown, None, ways=("map",))
    again = [after.answer(question).way == "map" for question, _ in solved]
    moved = [q for question, _ in solved for q in _moved(parts, question, args.seed)]
    by_map = [after.answer(question).way == "map" for question in track(moved, "moved questions", transient=True)]
    lengths = np.array([[_length(answer.motion), _length(after.answer(question).motion)] for question, answer in old]).reshape(-1, 2)
    figures = {
        "n_learned": len(solved) - refused,
        "n_refused": refused,
        "added_neurons": grown.roadmap.n_neurons - parts.roadmap.n_neurons,
        "same_question_by_map_share": float(np.mean(again)) if again else None,
        "n_moved": len(moved),
        "moved_by_map_share": float(np.mean(by_map)) if by_map else None,
        "n_old": len(old),
        "old_unsolved_now": int(np.count_nonzero(~np.isfinite(lengths[:, 1]))),
        "old_length_ratio": _ratios(lengths) if old else None,
    }
    print(json.dumps(figures, indent=2))
    if args.json is not None:
        report = {**provenance(args.seed, plain(config)), "set": args.name, "n": args.n, **figures}
        args.json.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    return 0


def _solved(parts: Parts, by_map: Answerer, asked: list[Question]) -> list[tuple[Question, F64]]:
    """The questions that the map alone did not answer and all ways did, with the paths."""
    solved = []
    with fallback_of(parts) as sampler:
        by_all = Answerer(parts, sampler)
        for question in track(asked, "questions to learn", transient=True):
            if by_map.answer(question).way is None:
                motion = by_all.answer(question).motion
                if isinstance(motion, Motion):
                    solved.append((question, motion.path.q_rad))
    return solved


def _learn(parts: Parts, solved: list[tuple[Question, F64]]) -> tuple[Parts, int]:
    """The parts with the map grown by what was solved as a live planner learns it, no journal kept; how many were refused."""
    student = Student(Memory(parts, None), parts.reflex(time.monotonic_ns, "learned"))
    refused = 0
    for question, path in track(solved, "learning", transient=True):
        try:
            parts = student.take_in(Lesson(path, source="repair", cells=question.cells)).parts
        except RequestError:
            refused += 1
    return parts, refused


def _moved(parts: Parts, question: Question, seed: int) -> list[Question]:
    """The question with start and goal moved, both free."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(question.index,)))
    checker, cells = parts.checker(), cells_of(parts.grid, question.cells)
    robot = parts.robot

    def near(q: F64) -> F64:
        for _ in range(DRAWS):
            step = rng.normal(size=len(q))
            moved = q + step / np.linalg.norm(step) * MOVED_RAD * rng.random()
            moved = np.clip(moved, robot.position_min_rad, robot.position_max_rad)
            if checker.pose(cells, moved)[0] == FREE:
                return np.asarray(moved)
        return q

    return [Question(question.index, near(question.q_start), near(question.q_goal), question.boxes_m, question.cells) for _ in range(MOVES)]


def _length(motion: Any) -> float:
    return float(motion.length_rad) if isinstance(motion, Motion) else float("inf")


def _ratios(lengths: F64) -> dict[str, float]:
    """Of the lengths (n, 2) after to before learning: median, largest, and how many are longer by more than a tenth."""
    ratio = lengths[:, 1] / np.maximum(lengths[:, 0], 1e-9)
    return {"p50": float(np.median(ratio)), "max": float(ratio.max()), "n_longer_by_a_tenth": int(np.count_nonzero(ratio > 1.1))}
