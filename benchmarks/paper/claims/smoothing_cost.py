"""Claim: smoothing is the costliest step of planning."""

from __future__ import annotations

from benchmarks.paper import words
from benchmarks.paper.ask import RULES, Variant
from benchmarks.paper.known import known
from benchmarks.paper.outcome import HOLDS, IN_PART, NOT, UNDECIDED, Holds, Outcome, Table, Verdict
from benchmarks.paper.shared_runs import scene_runs
from benchmarks.paper.stats import mean_sigma, median, percentile
from benchmarks.paper.study import Study

__all__ = ["STAGES", "measure"]

STAGES = ("update", "search", "smooth", "time", "verify")
EXPLAINED = {
    "update": "cells -> blocked neurons and edges",
    "search": "start and goal joined, graph search",
    "smooth": "paper's rules: NURBS; ours: corners cut, then rounded one by one as far as the arm stays free",
    "time": "timed within joint limits",
    "verify": "smoothed path looked at (paper's rules: its best matches; ours: what a hand could do; the rest was looked at before)",
}
SMOOTHING = ("smooth", "verify")  # the paper's smoothing includes looking whether the smoothed path is free
INTRO = (
    "GNG, Dijkstra, smoothed, on {n} scenes; milliseconds by stage. The paper's step of smoothing includes the look at the smoothed path "
    "(*verify*); timing within limits is no step of the paper and stands for itself. By our rules rounding a corner is itself a search "
    "for what is free, so *smooth* holds nearly all of the looks."
)


def measure(study: Study) -> Outcome:
    """Stages by rules."""
    runs = scene_runs(study, ("gng",), ("dijkstra",))
    stages: dict[str, dict[str, list[float]]] = {}
    rows = []
    for rules in RULES:
        solved = [r.answer for r in runs if r.variant == Variant("gng", "dijkstra", True, rules) and r.answer.solved]
        stages[rules] = {stage: [got.ms.get(stage, 0.0) for got in solved] for stage in STAGES}
        for stage in STAGES:
            values = stages[rules][stage]
            rows.append(
                [words.RULES_WORD[rules], f"{stage}: {EXPLAINED[stage]}", mean_sigma(values), median(values), percentile(values, 95.0)]
            )
    said = []
    for rules in RULES:
        smooth = [sum(values) for values in zip(*(stages[rules][stage] for stage in SMOOTHING), strict=True)]
        said.append(
            f"{words.RULES_WORD[rules]} rules: smoothing {median(smooth)} ms, search {median(stages[rules]['search'])} ms, update "
            f"{median(stages[rules]['update'])} ms (medians of {len(smooth)})"
        )
    verdict = Verdict(
        "Smoothing is the costliest step",
        f"{known('search_ms')} for the search, {known('smoothed_ms')} with smoothing",
        "; ".join(said),
        _holds([_costliest(stages[rules]) for rules in RULES]),
        "Smoothing here is *smooth* and *verify*. Absolute times differ by code and machine; the order of the steps is what is compared.",
    )
    raw = [
        {"row": r.variant.name, "question": r.question.index, **{f"{stage}_ms": r.answer.ms.get(stage) for stage in STAGES}}
        for r in runs
        if r.variant.smooth and r.answer.solved
    ]
    table = Table("Milliseconds by stage", ("rules", "stage", "mean ± σ, ms", "median, ms", "p95, ms"), rows)
    return Outcome(INTRO.format(n=study.scale.n_scenes), rows=raw, tables=[table], verdicts=[verdict], data=stages)


def _costliest(stages: dict[str, list[float]]) -> bool | None:
    """Whether smoothing takes longer than any other of the paper's steps, in all; None without an answer."""
    total = {stage: sum(values) for stage, values in stages.items()}
    if not stages["search"]:
        return None
    return sum(total[stage] for stage in SMOOTHING) > max(total["update"], total["search"])


def _holds(parts: list[bool | None]) -> Holds:
    decided = [part for part in parts if part is not None]
    if not decided:
        return UNDECIDED
    return HOLDS if all(decided) else IN_PART if any(decided) else NOT
