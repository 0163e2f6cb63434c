"""Ours beside a planner of others on the same questions: attempts, their figures, and where the other is better.

Raw is a path joined to start and goal as the search gives it, ours by the map, whose edges were looked at when its table was made, theirs
looked at on the way. Smoothed is our first answer after smoothing, timing and the exact look at the very curve, theirs after their own
simplification; they time nothing. Refined is our second answer, beside the same of theirs. Taking in the changed cells counts. Ours are by
all configured ways: what the map does not answer takes as long as repair or fallback take.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from benchmarks.answers import Answerer
from benchmarks.judging import Case, Shown, collisions
from benchmarks.paper.ask import dense
from benchmarks.peers.peer import Peer, path_length_rad
from benchmarks.questions import Question
from common.cell import CellConfig
from services.planner.core.motion import Motion

__all__ = ["KINDS", "OURS", "Attempt", "ask_ours", "ask_peer", "better_than_ours", "figures_of", "judged"]

F64 = NDArray[np.float64]
Kind = Literal["raw", "smoothed", "refined"]
KINDS: tuple[Kind, ...] = ("raw", "smoothed", "refined")
OURS = "ours"
PERCENTILES = {"p50": 50.0, "p95": 95.0, "p99": 99.0, "worst": 100.0}


@dataclass(frozen=True, eq=False)
class Attempt:
    """One planner at one question: path (P, J) or None, milliseconds since the cells changed, and the referee's word."""

    planner: str
    kind: Kind
    question: int
    path_rad: F64 | None
    ms: float
    collides: bool | None = None


def ask_ours(answerer: Answerer, question: Question) -> list[Attempt]:
    """Our raw path, first and refined motion, as configured (rules, search, ways), from an empty world on."""
    answer = answerer.answer(question)
    if not isinstance(answer.motion, Motion):
        return [Attempt(OURS, kind, question.index, None, answer.ms["answer"]) for kind in KINDS]
    return [
        Attempt(OURS, "raw", question.index, answer.motion.path.q_rad, answer.ms["connect_search"]),
        Attempt(OURS, "smoothed", question.index, dense(answer.motion), answer.ms["answer"]),
        Attempt(OURS, "refined", question.index, dense(answer.refined or answer.motion), answer.ms.get("refined", answer.ms["answer"])),
    ]


def ask_peer(peer: Peer, question: Question, limit_s: float, seed: int) -> list[Attempt]:
    """Both paths of one run of a peer."""
    got = peer.solve(question, limit_s, seed, True)
    raw_ms = 1e3 * (got.seconds["world"] + got.seconds["plan"])
    return [
        Attempt(peer.name, "raw", question.index, got.raw_rad, raw_ms),
        Attempt(peer.name, "smoothed", question.index, got.path_rad, 1e3 * got.seconds["total"]),
    ]


def judged(cell: CellConfig, attempts: Sequence[Attempt], questions: Sequence[Question], shown: Shown) -> list[Attempt]:
    """The same attempts with coal's word, at 1/256 rad on the questions' true boxes, on each path."""
    boxes_m = {question.index: question.boxes_m for question in questions}
    cases = [Case(a.path_rad, boxes_m[a.question]) for a in attempts if a.path_rad is not None]
    verdicts = iter(collisions(cell, cases, shown))
    return [a if a.path_rad is None else replace(a, collides=next(verdicts)) for a in attempts]


def figures_of(attempts: Sequence[Attempt], limit_ms: float) -> dict[str, Any]:
    """For each planner and kind: how much it solves, how long it takes, how long its paths are, how many collide.

    Questions that nobody solved are left out: no time could be given for them. A failure counts at ``limit_ms``. Lengths are compared
    with ours of the same kind where both have a path: theirs / ours (``length_to_ours``) and ours / theirs (``ours_to_length``), since the
    tail of the one is not that of the other. Beside our refined stands what of theirs is smoothed.
    """
    solvable = sorted({a.question for a in attempts if a.path_rad is not None})
    names = list(dict.fromkeys(a.planner for a in attempts))
    found: dict[str, Any] = {"n_questions": len({a.question for a in attempts}), "n_solvable": len(solvable), "planners": {}}
    for name in names:
        found["planners"][name] = {}
        for kind in KINDS:
            same = "smoothed" if kind == "refined" and name != OURS else kind
            mine = {a.question: a for a in attempts if (a.planner, a.kind) == (name, same)}
            ours = {a.question: a for a in attempts if (a.planner, a.kind) == (OURS, kind)}
            found["planners"][name][kind] = _row(mine, ours, solvable, limit_ms)
    for name in names:
        for kind in KINDS:
            row, ours_ms = found["planners"][name][kind], found["planners"][OURS][kind]["time_ms"]
            if name != OURS and row["time_ms"] and ours_ms:
                row["times_ours"] = {key: round(row["time_ms"][key] / max(ours_ms[key], 1e-9), 2) for key in PERCENTILES}
    return found


def _row(mine: dict[int, Attempt], ours: dict[int, Attempt], solvable: Sequence[int], limit_ms: float) -> dict[str, Any]:
    solved = [k for k in solvable if mine[k].path_rad is not None]
    lengths = {k: _length(mine[k]) for k in solved}
    ratios = [lengths[k] / _length(ours[k]) for k in solved if ours[k].path_rad is not None and _length(ours[k]) > 0.0]
    return {
        "n_solved": len(solved),
        "solved_share": round(len(solved) / len(solvable), 4) if solvable else None,
        "time_ms": _percentiles([mine[k].ms if mine[k].path_rad is not None else limit_ms for k in solvable]),
        "solved_time_ms": _percentiles([mine[k].ms for k in solved]),
        "length_rad_median": round(float(np.median(list(lengths.values()))), 3) if lengths else None,
        "length_to_ours": _middle_and_tail(ratios),
        "ours_to_length": _middle_and_tail([1.0 / ratio for ratio in ratios]),
        "n_compared": len(ratios),
        "collisions": sum(bool(mine[k].collides) for k in solved),
    }


def _length(attempt: Attempt) -> float:
    assert attempt.path_rad is not None
    return path_length_rad(attempt.path_rad)


def _middle_and_tail(ratios: Sequence[float]) -> dict[str, float] | None:
    return {"median": round(float(np.median(ratios)), 3), "p95": round(float(np.percentile(ratios, 95.0)), 3)} if ratios else None


def _percentiles(values: Sequence[float]) -> dict[str, float] | None:
    return {key: round(float(np.percentile(values, percent)), 3) for key, percent in PERCENTILES.items()} if values else None


def better_than_ours(figures: dict[str, Any]) -> list[str]:
    """In plain words all in which a peer does better than ours, of the same kind."""
    said = []
    for name, kinds in figures["planners"].items():
        for kind in KINDS if name != OURS else ():
            row, ours = kinds[kind], figures["planners"][OURS][kind]
            head = f"{name}, {kind}"
            if row["n_solved"] > ours["n_solved"]:
                said.append(f"{head}: solves more ({row['n_solved']} against {ours['n_solved']} of {figures['n_solvable']})")
            if row["time_ms"] and ours["time_ms"]:
                faster = [key for key in PERCENTILES if row["time_ms"][key] < ours["time_ms"][key]]
                said += [f"{head}: faster at {key} ({row['time_ms'][key]:g} against {ours['time_ms'][key]:g} ms)" for key in faster]
            ratio = row["length_to_ours"]
            if ratio and ratio["median"] < 1.0:
                said.append(f"{head}: shorter paths (median {ratio['median']:.3f} of ours, {row['n_compared']} questions)")
            if row["collisions"] < ours["collisions"]:
                said.append(f"{head}: fewer paths that collide ({row['collisions']} against {ours['collisions']})")
    return said
