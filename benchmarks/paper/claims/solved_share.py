"""What share of the questions each map solves, and how long it takes: the success rate that the paper does not give."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from benchmarks.paper import words
from benchmarks.paper.ask import RULES, Variant, answer
from benchmarks.paper.outcome import HOLDS, NOT, UNDECIDED, Holds, Outcome, Table, Verdict
from benchmarks.paper.stats import mcnemar, percentile, share
from benchmarks.paper.study import MODELS, Study
from benchmarks.questions import Question
from benchmarks.solvable import is_solvable

__all__ = ["Solved", "measure", "verdict_on"]

BY_CHANCE = 0.05
INTRO = (
    "The {n} questions of the set “task” that `tolman bench replan` asks too, put to each map: Dijkstra, smoothed, by both rules, the map "
    "alone. *Solvable* is what one of the maps solves by our rules or else RRTConnect in {limit:g} s, in full joint space under the same "
    "inflation. An answer by the paper's rules counts even if it touches something (Table I says how often that is), so it may solve "
    "what is not solvable with the distance kept."
)


@dataclass(frozen=True)
class Solved:
    """One map by one set of rules: for each question whether it was solved, and the milliseconds of the answer, solved or not."""

    rules: str
    model: str
    solved: tuple[bool, ...]
    ms: tuple[float, ...]


def measure(study: Study) -> Outcome:
    """Every map by both rules on the same questions."""
    asked = study.scenes(study.scale.n_share_scenes)
    found = [_solved(study, asked, Variant(model, "dijkstra", True, rules)) for rules in RULES for model in MODELS]
    solvable = _solvable(study, asked, found)
    columns = ("rules", "model", "solved of all", "solved of the solvable", "answer p50, ms", "p95, ms", "p99, ms", "no answer p95, ms")
    note = f"{sum(solvable)} of {len(asked)} questions are solvable. Shares with their 95 % interval; times from changed cells on."
    raw = [
        {"row": f"{s.model}-dijkstra-smoothed-{s.rules}", "question": q.index, "solved": done, "solvable": can, "total_ms": ms}
        for s in found
        for q, done, can, ms in zip(asked, s.solved, solvable, s.ms, strict=True)
    ]
    return Outcome(
        INTRO.format(n=len(asked), limit=study.scale.solvable_limit_s),
        rows=raw,
        tables=[Table(f"{len(asked)} questions", columns, [_row(s, solvable) for s in found], note)],
        verdicts=[verdict_on(found, solvable, rules) for rules in RULES],
        data=(found, solvable),
    )


def _solved(study: Study, asked: Sequence[Question], variant: Variant) -> Solved:
    parts = study.parts(variant.model)
    planner = study.once(f"planner {variant.model}", parts.motion_planner)
    answer(parts, planner, asked[0], variant)  # what is cached on first use is not measured
    answers = [answer(parts, planner, question, variant) for question in study.shown(asked, variant.name, len(asked))]
    return Solved(variant.rules, variant.model, tuple(a.solved for a in answers), tuple(a.ms["total"] for a in answers))


def _solvable(study: Study, asked: Sequence[Question], found: Sequence[Solved]) -> list[bool]:
    ours = [any(s.solved[k] for s in found if s.rules == "checked") for k in range(len(asked))]
    limit_s = study.scale.solvable_limit_s
    shown = study.shown(asked, "solvable?", len(asked))
    return [done or is_solvable(study.gng, question, limit_s) for question, done in zip(shown, ours, strict=True)]


def _row(s: Solved, solvable: Sequence[bool]) -> list[str]:
    times = [ms for ms, done in zip(s.ms, s.solved, strict=True) if done]
    vain = [ms for ms, done in zip(s.ms, s.solved, strict=True) if not done]
    return [
        words.RULES_WORD[s.rules],
        words.MODEL[s.model],
        share(sum(s.solved), len(s.solved)),
        share(_of_solvable(s, solvable), sum(solvable)),
        *(percentile(times, percent, 1) for percent in (50.0, 95.0, 99.0)),
        percentile(vain, 95.0, 1),
    ]


def _of_solvable(s: Solved, solvable: Sequence[bool]) -> int:
    return sum(done and can for done, can in zip(s.solved, solvable, strict=True))


def verdict_on(found: Sequence[Solved], solvable: Sequence[bool], rules: str) -> Verdict:
    """Whether GNG solves more than both lattices, beyond chance (McNemar's exact test on the same questions)."""
    by = {s.model: s for s in found if s.rules == rules}
    gng = by["gng"]
    parts: list[Holds] = []
    details = []
    for model in ("som", "gamma_som"):
        p = mcnemar(by[model].solved, gng.solved)
        more = sum(gng.solved) > sum(by[model].solved)
        parts.append(UNDECIDED if p >= BY_CHANCE else HOLDS if more else NOT)
        only = [sum(a and not b for a, b in zip(x.solved, y.solved, strict=True)) for x, y in ((gng, by[model]), (by[model], gng))]
        details.append(f"GNG alone solves {only[0]}, {words.MODEL[model]} alone {only[1]} (p = {p:.2g}, McNemar)")
    holds = HOLDS if set(parts) == {HOLDS} else NOT if NOT in parts else UNDECIDED
    said = ", ".join(f"{words.MODEL[model]} {sum(by[model].solved)}" for model in MODELS)
    return Verdict(
        f"GNG solves more questions than SOM and γ-SOM ({words.RULES_WORD[rules]} rules)",
        "γ-SOM fails more often; no success rate at hand",
        f"{said} of {len(solvable)} questions; {sum(solvable)} of them are solvable",
        holds,
        "Start and goal are inverse-kinematics poses off the training motions; nothing but the map answers.",
        details,
    )
