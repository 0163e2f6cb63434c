"""Runs that several parts of the report look at: every way of planning on every scene, and the one question of the tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from benchmarks.paper.ask import ALGORITHMS, Answer, Variant, answer, variants
from benchmarks.paper.judge import Case, collisions
from benchmarks.paper.study import MODELS, Study
from benchmarks.questions import Question

__all__ = ["Run", "scene_runs", "the_question", "with_verdicts"]

CANDIDATES = 40  # questions among which the one of the tables is looked for


@dataclass(frozen=True, eq=False)
class Run:
    """One answer to one question; ``collides`` is None where there is no path."""

    variant: Variant
    question: Question
    answer: Answer
    collides: bool | None = None


def the_question(study: Study) -> Question:
    """Start, goal and boxes of the tables: the first question that every map answers by every rule, so that no row is empty.

    On small maps there may be none among the first 40; then the one with most answers.
    """

    def search() -> Question:
        asked = variants(MODELS, ("dijkstra",))
        best, most = None, -1
        for question in study.scenes(min(CANDIDATES, 10 * study.scale.n_scenes)):
            solved = sum(_ask(study, variant, question).solved for variant in asked)
            if solved == len(asked):
                return question
            if solved > most:
                best, most = question, solved
        assert best is not None
        return best

    return study.once("the question", search)


def scene_runs(study: Study, models: Sequence[str] = MODELS, searches: Sequence[str] = ALGORITHMS) -> list[Run]:
    """Every way of planning on each of ``n_scenes`` scenes; shared by all who ask, so measured once."""
    wanted = [v for v in variants(tuple(MODELS), tuple(ALGORITHMS)) if v.model in models and v.search in searches]
    kept: dict[tuple[Variant, int], Run] = study.once("scene runs", dict)
    scenes = study.scenes(study.scale.n_scenes)
    for variant in study.shown(wanted, "planning", len(wanted)):
        if (variant, scenes[0].index) in kept:
            continue
        _ask(study, variant, scenes[0])  # what is compiled or cached on first use is not measured
        for question in scenes:
            kept[variant, question.index] = Run(variant, question, _ask(study, variant, question))
    return [kept[variant, question.index] for variant in wanted for question in scenes]


def with_verdicts(study: Study, runs: Sequence[Run]) -> list[Run]:
    """The same runs with the referee's word on each path."""
    solved = [run for run in runs if run.answer.solved]
    verdicts = iter(collisions(study, [Case(run.answer.path_rad, run.question.boxes_m) for run in solved]))
    return [Run(r.variant, r.question, r.answer, next(verdicts) if r.answer.solved else None) for r in runs]


def _ask(study: Study, variant: Variant, question: Question) -> Answer:
    parts = study.parts(variant.model)
    planner = study.once(f"planner {variant.model}", parts.motion_planner)
    return answer(parts, planner, question, variant)
