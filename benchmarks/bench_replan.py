"""The world changed: how long until a motion round it is ready to send, how often there is one, and does it ever collide.

connect_search_ms: changed cells -> path joined to the true start and goal. answer_ms: -> smoothed, timed, checked, ready to send.
refined_ms: -> the second, shorter answer, refine_ms after the first. All are of what the map alone solved, as are n_solved and
solved_share; all_ways adds repair and fallback. Each question starts from an empty world. Solvable means: RRTConnect solves it in 5 s under
the same inflation. The first hundred questions are put to two more processes, which must give the same bytes; of those that stay open only
two, since each takes the fallback to its bound.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import track

from benchmarks.answers import Answer, Answerer, fallback_of, percentiles
from benchmarks.equal_answers import are_equal_elsewhere, to_repeat
from benchmarks.provenance import provenance
from benchmarks.questions import SETS, Question, questions
from benchmarks.referee import Referee, at_steps
from benchmarks.solvable import are_solvable
from common.cell import load
from common.config import plain
from common.errors import RequestError
from services.planner.assemble import assemble
from services.planner.config import PlannerConfig
from services.planner.core.motion import Motion
from services.planner.rehearsal import rehearse

__all__ = ["add_arguments", "run"]


WITHIN_S = (1.0, 5.0)  # issue


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which questions, and where the figures go."""
    parser.add_argument("--set", dest="name", default="task", choices=SETS, help="questions (default %(default)s)")
    parser.add_argument("--n", type=int, default=500, help="how many (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path, default=None, metavar="FILE")
    parser.add_argument("--config", type=Path, default=None, metavar="FILE", help="cell config; default: the UR3 cell")
    parser.add_argument("--override", action="append", default=[], metavar="KEY=VALUE", help="as --set elsewhere: planner.search=astar")


def run(args: argparse.Namespace) -> int:
    """Measure, judge, print, write."""
    if args.n < 1:
        raise RequestError(f"--n {args.n}: at least one question is needed", code="out_of_range")
    cell, config = load(args.config, "planner", PlannerConfig, args.override)
    parts = assemble(cell, config)
    rehearse(parts, time.monotonic_ns)
    asked = list(track(questions(parts, args.name, args.n, args.seed), "questions", total=args.n, transient=True))
    with fallback_of(parts) as sampler:
        answerer = Answerer(parts, sampler)
        answers = [answerer.answer(question) for question in _shown(asked, "answers")]
    open_ones = [question for question, answer in zip(asked, answers, strict=True) if answer.way is None]  # what we solved needs no proof
    proofs = are_solvable(args.config, args.override, open_ones)
    n_solvable = len(asked) - len(open_ones) + sum(track(proofs, "solvable?", total=len(open_ones), transient=True))
    referee = Referee(parts.robot, cell.static)
    collisions = 0
    for question, answer in zip(_shown(asked, "referee"), answers, strict=True):
        for motion in {answer.motion, answer.refined}:
            if isinstance(motion, Motion):
                collisions += referee.collides(at_steps(_dense(motion)), question.boxes_m)
    figures = _figures(answers, n_solvable, collisions)
    figures["equal_answers_in_3_processes"] = are_equal_elsewhere(args.config, args.override, *to_repeat(asked, answers))
    report = {**provenance(args.seed, plain(config)), "set": args.name, "n": args.n, **figures}
    print(json.dumps(figures, indent=2))
    if args.json is not None:
        args.json.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    return 0


def _shown(asked: list[Question], what: str) -> Any:
    return track(asked, what, transient=True)


def _dense(motion: Motion) -> Any:
    """The curve itself between its knots, close enough together that straight pieces are the curve."""
    times = np.linspace(0.0, motion.curve.duration_s, 20 * len(motion.curve.t_s))
    return motion.curve.sample(times)[0]


def _figures(answers: list[Answer], n_solvable: int, collisions: int) -> dict[str, Any]:
    by_map = [answer for answer in answers if answer.way == "map"]
    stages = ("connect_search", "answer", "refined", "update", "search", "smooth", "time", "verify", "refine")
    milliseconds = {stage: [answer.ms[stage] for answer in by_map if stage in answer.ms] for stage in stages}
    return {
        "n_solvable": n_solvable,
        "n_solved": len(by_map),
        "solved_share": len(by_map) / max(1, n_solvable),
        "all_ways": _all_ways(answers, n_solvable),
        "collisions": collisions,
        "refined_to_first_length": _shortened(by_map),
        "fell_back": sum(isinstance(answer.motion, Motion) and answer.motion.fell_back for answer in answers),
        **{f"{stage}_ms": percentiles(values) for stage, values in milliseconds.items() if values},
    }


def _shortened(answers: list[Answer]) -> dict[str, float]:
    """Length of refined answers as a share of the first ones'."""
    pairs = [(a.refined, a.motion) for a in answers]
    return percentiles([b.length_rad / a.length_rad for b, a in pairs if b is not None and isinstance(a, Motion) and a.length_rad > 0.0])


def _all_ways(answers: list[Answer], n_solvable: int) -> dict[str, Any]:
    """Solved shares of the solvable by all ways together, and for each way how many it solved and how long an answer took."""
    took_ms = [answer.ms["answer"] for answer in answers if answer.way is not None]
    figures: dict[str, Any] = {"n_solved": len(took_ms), "solved_share": len(took_ms) / max(1, n_solvable)}
    for within_s in WITHIN_S:
        figures[f"solved_share_within_{within_s:g}_s"] = sum(ms <= within_s * 1e3 for ms in took_ms) / max(1, n_solvable)
    for way in ("map", "repair", "fallback"):
        mine = [answer.ms["answer"] for answer in answers if answer.way == way]
        figures[way] = {"n_solved": len(mine), **({"ms": percentiles(mine)} if mine else {})}
    again = [answer.ms["answer"] for answer in answers if answer.way == "map" and "repair" in answer.ms]
    figures["map"]["n_by_more_connections"] = len(again)
    unsolved = [answer.ms["answer"] for answer in answers if answer.way is None]
    figures["unsolved"] = {"n": len(unsolved), **({"ms": percentiles(unsolved)} if unsolved else {})}
    return figures
