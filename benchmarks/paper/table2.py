"""Table II: growing neural gas with smoothing against PRM, RRT and RRTConnect of OMPL, on the same questions, cells and margins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.paper import words
from benchmarks.paper.ask import RULES, Variant, answer
from benchmarks.paper.judge import Case, collisions
from benchmarks.paper.known import known
from benchmarks.paper.outcome import HOLDS, IN_PART, NOT, NOT_AT_HAND, UNDECIDED, Outcome, Table, Verdict
from benchmarks.paper.shared_runs import the_question
from benchmarks.paper.stats import mean_sigma, percentile, share
from benchmarks.paper.study import Study
from benchmarks.peers.peer import Setting, path_length_rad
from benchmarks.peers.registry import make_peer
from benchmarks.questions import Question
from common.errors import RequestError

__all__ = ["PLANNERS", "PeerRun", "measure", "name_of", "peer_runs", "verdict_on_time"]

F64 = NDArray[np.float64]
REPLAN_MS = 20.0  # the paper's abstract
PLANNERS = ("ompl_prm", "ompl_rrt", "ompl_rrt_connect")
OURS = tuple(Variant("gng", "dijkstra", True, rules) for rules in RULES)
COLUMNS = ("planner", "solved", "time, ms", "p95, ms", "length, rad", "collide (coal)", "paper")
INTRO = (
    "PRM, RRT and RRTConnect of OMPL plan in full joint space with coal on convex pieces of the arm as collision checker: the same "
    "cells, the same margins to cells, static layer and the arm itself, motions checked every 0.03 rad, ranges tuned on other questions "
    "(see `benchmarks/peers/ompl_peers.py`). *Simplified* is OMPL's own `PathSimplifier.simplify` to its end. A run counts as failed "
    "after {limit:g} s. PRM starts from nothing with each question, as the cells change. First the paper's protocol, {n} runs of one "
    "start and goal; then {scenes} scenes, one run each."
)


@dataclass(frozen=True, eq=False)
class PeerRun:
    """One run of one way of planning: path (P, J) or None, milliseconds, and the referee's word."""

    planner: str
    question: int
    seed: int
    path_rad: F64 | None
    ms: float
    collides: bool | None = None


def measure(study: Study) -> Outcome:
    """Both tables."""
    n, scenes, question = study.scale.n_runs, study.scenes(study.scale.n_scenes), the_question(study)
    if not any(study.only in name for name in (*PLANNERS, *(v.name for v in OURS))):
        raise RequestError(
            f"--only {study.only}: no row is called so; rows are: {', '.join((*PLANNERS, *(v.name for v in OURS)))}", code="unknown_row"
        )
    one = _judged(study, [*_ours(study, [question] * n), *peer_runs(study, [question] * n)], {question.index: question})
    many = _judged(study, [*_ours(study, scenes), *peer_runs(study, scenes)], {q.index: q for q in scenes})
    tables = [
        Table(f"One question (no. {question.index}), {n} runs", COLUMNS, _rows(one), _note(study)),
        Table(f"{len(scenes)} scenes, one run each", COLUMNS, _rows(many), "Times and lengths: mean ± σ over what was solved."),
    ]
    return Outcome(
        INTRO.format(limit=study.scale.peer_limit_s, n=n, scenes=len(scenes)),
        rows=[{"table": "one question", **_raw(run)} for run in one] + [{"table": "scenes", **_raw(run)} for run in many],
        tables=tables,
        verdicts=[verdict_on_time(many)],
    )


def verdict_on_time(runs: Sequence[PeerRun]) -> Verdict:
    """Whether an answer is there within the paper's 0.02 s: at the median by both rules, and in 95 of 100 cases."""
    times = {p: [r.ms for r in runs if r.planner == p and r.path_rad is not None] for p in dict.fromkeys(r.planner for r in runs)}
    ours = [values for planner, values in times.items() if planner.startswith("gng") and values]
    at_95 = [float(np.percentile(values, 95.0)) <= REPLAN_MS for values in ours]
    at_50 = [float(np.median(values)) <= REPLAN_MS for values in ours]
    details = [
        f"{name_of(planner)}: median {percentile(v, 50, 1)} ms, p95 {percentile(v, 95, 1)} ms, n = {len(v)}" for planner, v in times.items()
    ]
    return Verdict(
        "A motion is re-planned within 0.02 s",
        f"{known('replan_s')} (abstract)",
        "; ".join(f"p95 {percentile(v, 95, 1)} ms ({name_of(p).rpartition(', ')[2]})" for p, v in times.items() if p.startswith("gng")),
        UNDECIDED if not ours else HOLDS if all(at_95) else IN_PART if any(at_50) else NOT,
        "From changed cells to a smoothed, timed motion, over the scenes that were solved; seeing comes before that, see the dodge.",
        details,
    )


def _note(study: Study) -> str:
    return (
        f"mean ± σ of {study.scale.n_runs}; time: from changed cells to a path (ours: to a timed, smoothed motion; simplified peers: "
        f"with simplification). The paper gives {known('smoothed_ms')} for its own search and smoothing; its numbers for the samplers "
        "are not at hand."
    )


def peer_runs(study: Study, asked: Sequence[Question]) -> list[PeerRun]:
    """Each planner on each question, raw and simplified from the same run; the k-th question is asked with seed k."""
    runs: list[PeerRun] = []
    for name in PLANNERS:
        if study.only not in name:
            continue
        peer = make_peer(name, Setting.of_parts(study.gng))
        peer.prepare()
        for k, question in enumerate(study.shown(asked, name, len(asked))):
            got = peer.solve(question, study.scale.peer_limit_s, study.seed + k, True)
            plan_ms = 1e3 * (got.seconds["world"] + got.seconds["plan"])
            runs.append(PeerRun(f"{name}-raw", question.index, study.seed + k, got.raw_rad, plan_ms))
            runs.append(PeerRun(f"{name}-simplified", question.index, study.seed + k, got.path_rad, 1e3 * got.seconds["total"]))
    return runs


def _ours(study: Study, asked: Sequence[Question]) -> list[PeerRun]:
    parts, runs = study.gng, []
    for variant in OURS:
        if study.only not in variant.name:
            continue
        planner = parts.motion_planner()
        answer(parts, planner, asked[0], variant)  # what is cached on first use is not measured
        for k, question in enumerate(asked):
            got = answer(parts, planner, question, variant)
            runs.append(PeerRun(variant.name, question.index, k, got.path_rad if got.solved else None, got.ms["total"]))
    return runs


def _judged(study: Study, runs: Sequence[PeerRun], questions: dict[int, Question]) -> list[PeerRun]:
    solved = [run for run in runs if run.path_rad is not None]
    cases = [Case(run.path_rad, questions[run.question].boxes_m) for run in solved if run.path_rad is not None]
    verdicts = iter(collisions(study, cases))
    return [PeerRun(r.planner, r.question, r.seed, r.path_rad, r.ms, None if r.path_rad is None else next(verdicts)) for r in runs]


def name_of(planner: str) -> str:
    """How a table calls a way of planning."""
    if planner.startswith("gng"):
        return f"GNG + Dijkstra + smoothing, {words.RULES_WORD[planner.rpartition('-')[2]]} rules"
    name, _, how = planner.partition("-")
    return f"{words.PEER[name]}, {how}"


def _rows(runs: Sequence[PeerRun]) -> list[list[str]]:
    return [_row([run for run in runs if run.planner == planner]) for planner in dict.fromkeys(run.planner for run in runs)]


def _row(runs: Sequence[PeerRun]) -> list[str]:
    solved = [run for run in runs if run.path_rad is not None]
    hits = sum(bool(run.collides) for run in solved)
    times = [run.ms for run in solved]
    is_ours = runs[0].planner.startswith("gng")
    return [
        name_of(runs[0].planner),
        share(len(solved), len(runs)),
        mean_sigma(times, 1),
        percentile(times, 95.0, 1),
        mean_sigma([path_length_rad(run.path_rad) for run in solved if run.path_rad is not None]),
        f"**{hits}** of {len(solved)}" if hits else f"0 of {len(solved)}",
        known("smoothed_ms") if is_ours and runs[0].planner.endswith("paper") else NOT_AT_HAND,
    ]


def _raw(run: PeerRun) -> dict[str, Any]:
    solved = run.path_rad is not None
    return {
        "row": run.planner,
        "question": run.question,
        "seed": run.seed,
        "solved": solved,
        "ms": run.ms,
        "length_rad": path_length_rad(run.path_rad) if run.path_rad is not None else None,
        "collides": run.collides,
    }
