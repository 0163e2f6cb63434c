"""Claim: the same question gives the same path, where sampling planners give another each time."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from benchmarks.paper.ask import RULES, Variant, answer
from benchmarks.paper.outcome import HOLDS, NOT, NOT_AT_HAND, UNDECIDED, Outcome, Table, Verdict
from benchmarks.paper.shared_runs import the_question
from benchmarks.paper.stats import mean_sigma
from benchmarks.paper.study import Study
from benchmarks.paper.table2 import PLANNERS, name_of, peer_runs
from benchmarks.peers.peer import path_length_rad

__all__ = ["measure"]

F64 = NDArray[np.float64]
INTRO = (
    "The question of Table I, {n} times: ours with planners made anew each time, the sampling planners with a new seed each time, as "
    "they run by default. Equal means equal bytes of the whole path."
)


def measure(study: Study) -> Outcome:
    """Distinct paths among the runs, and the spread of their lengths."""
    n, question = study.scale.n_runs, the_question(study)
    paths: dict[str, list[F64]] = {}
    for rules in RULES:
        variant = Variant("gng", "dijkstra", True, rules)
        answers = [answer(study.gng, study.gng.motion_planner(), question, variant) for _ in study.shown(range(n), "ours", n)]
        paths[variant.name] = [got.path_rad for got in answers if got.solved]
    for run in peer_runs(study, [question] * n):
        paths.setdefault(run.planner, []).extend([] if run.path_rad is None else [run.path_rad])
    rows = [_row(name, found) for name, found in paths.items()]
    table = Table(
        "Runs of one question",
        ("planner", "runs with a path", "different paths", "length, rad", "longest / shortest"),
        [[name_of(str(r["row"])), str(r["paths"]), str(r["distinct"]), str(r["length"]), str(r["spread"])] for r in rows],
    )
    ours = [r for r in rows if str(r["row"]).startswith("gng")]
    samplers = [r for r in rows if str(r["row"]).rpartition("-")[0] in PLANNERS]
    solved = all(r["paths"] for r in ours)
    same = all(r["distinct"] == 1 and r["paths"] == n for r in ours)
    said = [f"{name_of(str(r['row']))}: {r['distinct']} different of {r['paths']}, length {r['length']} rad" for r in [*ours, *samplers]]
    distinct = [int(r["distinct"]) for r in samplers] or [0]
    verdict = Verdict(
        "Paths are reproducible",
        NOT_AT_HAND,
        (
            f"different paths in {n} runs: {max((int(r['distinct']) for r in ours), default=0)} (GNG), {min(distinct)} to "
            f"{max(distinct)} (samplers)"
        ),
        HOLDS if same else NOT if solved else UNDECIDED,
        "With equal seeds OMPL's RRT and RRTConnect repeat themselves too, as long as no time limit cuts in; PRM grows by the clock.",
        said,
    )
    return Outcome(INTRO.format(n=n), rows=rows, tables=[table], verdicts=[verdict], data=_lengths(paths))


def _lengths(paths: dict[str, list[F64]]) -> dict[str, list[float]]:
    return {name: [path_length_rad(path) for path in found] for name, found in paths.items()}


def _row(name: str, found: Sequence[F64]) -> dict[str, str | int]:
    lengths = [path_length_rad(path) for path in found]
    digests = {hashlib.sha256(np.ascontiguousarray(path).tobytes()).hexdigest() for path in found}
    spread = f"{max(lengths) / min(lengths):.3f}" if lengths and min(lengths) > 0.0 else "–"
    return {"row": name, "paths": len(found), "distinct": len(digests), "length": mean_sigma(lengths), "spread": spread}
