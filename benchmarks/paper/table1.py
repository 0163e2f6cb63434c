"""Table I: model, algorithm, smoothed or not; neurons on the path, time, length; and what the paper does not have: true collisions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from benchmarks.paper import words
from benchmarks.paper.ask import RULES, Variant, answer, variants
from benchmarks.paper.known import known
from benchmarks.paper.outcome import HOLDS, NOT, NOT_AT_HAND, UNDECIDED, Outcome, Table, Verdict
from benchmarks.paper.shared_runs import Run, scene_runs, the_question, with_verdicts
from benchmarks.paper.stats import mean_sigma, percentile, share
from benchmarks.paper.study import MODELS, Study

__all__ = ["measure", "verdict_on_collisions"]

PAPERS_ROWS = 5  # issue: the paper's five rows
HEAD = ("rules", "model", "algorithm", "smoothed")
ONE = (*HEAD, "neurons on the path", "path, ms", "answer, ms", "length, rad", "collides (coal)", "paper: ms")
MANY = (*HEAD, "solved", "rejected / with a stop", "neurons", "path, ms", "answer, ms", "answer p95, ms", "length, rad", "collide (coal)")
INTRO = (
    "One question (start, goal, boxes; the first of the set “task” that every map answers by both rules) is put to each map by each "
    "algorithm, {n} times from an empty world, as in the paper. The same question gives the same path each time, so the spread is the "
    "clock's. *Path* is all from changed cells to a path on the map; *answer* is all until a timed motion may be sent (raw: a stop at "
    "each corner). By the paper's rules start and goal snap to their best matches, neurons alone are blocked, and the path is smoothed "
    "by a NURBS, from very smooth down until its best matches are free; if none is (*rejected*), the raw path is driven. By our rules "
    "(`checked`) start and goal are joined by checked ways, edges are blocked too, corners are cut and then rounded one by one as far as "
    "the arm stays free (one that cannot be is stopped at: *with a stop*), and what would be driven was looked at piece by piece. The "
    "second table puts {scenes} scenes to each; its last column is coal's word at steps of 1/256 rad, on true shapes, without any margin."
)


def measure(study: Study) -> Outcome:
    """Both tables."""
    question = the_question(study)
    asked = variants(MODELS, only=study.only)
    repeats = {variant: _repeat(study, variant) for variant in study.shown(asked, "20 runs of one question", len(asked))}
    firsts = with_verdicts(study, [runs[0] for runs in repeats.values()])
    verdict = {run.variant: run.collides for run in firsts}
    runs = with_verdicts(study, [run for run in scene_runs(study) if run.variant in repeats])
    one = Table(
        f"One question (no. {question.index} of the set “task”), {study.scale.n_runs} runs",
        ONE,
        [_row_of_one(variant, runs_of, verdict[variant]) for variant, runs_of in repeats.items()],
        f"mean ± σ of {study.scale.n_runs}. Which of the paper's rows its {known('search_ms')} and {known('smoothed_ms')} belong to is "
        "not at hand: they stand beside GNG with Dijkstra. Its machine is not at hand either.",
    )
    many = Table(
        f"{study.scale.n_scenes} scenes, one run each",
        MANY,
        [_row_of_many([run for run in runs if run.variant == variant]) for variant in asked],
        "mean ± σ over the scenes that were solved; “solved” with its 95 % interval. A path counts as colliding if it touches a box, the "
        "table, a bin or the arm itself.",
    )
    return Outcome(
        INTRO.format(n=study.scale.n_runs, scenes=study.scale.n_scenes),
        rows=[_raw(run, k, "one question") for runs_of in repeats.values() for k, run in enumerate(runs_of)]
        + [_raw(run, 0, "scenes") for run in runs],
        tables=[_papers_table(), one, many],
        verdicts=[verdict_on_collisions(runs, rules) for rules in RULES],
        facts={"question": {"index": question.index, "q_start_rad": question.q_start.tolist(), "q_goal_rad": question.q_goal.tolist()}},
    )


def _papers_table() -> Table:
    """What is at hand of the paper's five rows."""
    rows = [
        [NOT_AT_HAND, NOT_AT_HAND, "no", NOT_AT_HAND, known("search_ms"), NOT_AT_HAND],
        [NOT_AT_HAND, NOT_AT_HAND, "yes", NOT_AT_HAND, known("smoothed_ms"), NOT_AT_HAND],
        *[[NOT_AT_HAND] * 6] * (PAPERS_ROWS - 2),
    ]
    note = "Its columns, and as much of its rows as could be read; the rest is left open rather than guessed."
    return Table("The paper's Table I", ("model", "algorithm", "smoothed", "neurons on the path", "mean of 20", "σ of 20"), rows, note)


def _repeat(study: Study, variant: Variant) -> list[Run]:
    parts, question = study.parts(variant.model), the_question(study)
    planner = parts.motion_planner()
    answer(parts, planner, question, variant)  # what is cached on first use is not measured
    return [Run(variant, question, answer(parts, planner, question, variant)) for _ in range(study.scale.n_runs)]


def _row_of_one(variant: Variant, runs: Sequence[Run], collides: bool | None) -> list[str]:
    first = runs[0].answer
    head = words.row_head(variant)
    if first.fell_back:
        head[-1] = "yes, rejected" if variant.rules == "paper" else "yes, with a stop"
    paper = NOT_AT_HAND
    if (variant.model, variant.search, variant.rules) == ("gng", "dijkstra", "paper"):
        paper = known("smoothed_ms" if variant.smooth else "search_ms")
    if not first.solved:
        return [*head, "–", "–", "–", f"no path ({first.outcome})", "–", paper]
    return [
        *head,
        str(len(first.neurons)),
        mean_sigma([run.answer.ms["path"] for run in runs]),
        mean_sigma([run.answer.ms["total"] for run in runs]),
        f"{first.length_rad:.2f}",
        "–" if collides is None else words.yes_no(collides),
        paper,
    ]


def _row_of_many(runs: Sequence[Run]) -> list[str]:
    solved = [run for run in runs if run.answer.solved]
    times = [run.answer.ms["total"] for run in solved]
    hits = sum(bool(run.collides) for run in solved)
    return [
        *words.row_head(runs[0].variant),
        share(len(solved), len(runs)),
        str(sum(run.answer.fell_back for run in solved)) if runs[0].variant.smooth else "",
        mean_sigma([float(len(run.answer.neurons)) for run in solved], 1),
        mean_sigma([run.answer.ms["path"] for run in solved]),
        mean_sigma(times),
        percentile(times, 95.0),
        mean_sigma([run.answer.length_rad for run in solved]),
        f"**{hits}** of {len(solved)}" if hits else f"0 of {len(solved)}",
    ]


def verdict_on_collisions(runs: Sequence[Run], rules: str) -> Verdict:
    """Whether all paths of one set of rules are free, and how many of the smoothed and raw paths of each map are not."""
    solved = [run for run in runs if run.variant.rules == rules and run.answer.solved]
    hits = sum(bool(run.collides) for run in solved)
    details = []
    for model in MODELS:
        for smooth in (False, True):
            mine = [run for run in solved if (run.variant.model, run.variant.smooth) == (model, smooth)]
            how = "smoothed" if smooth else "raw"
            details.append(f"{words.MODEL[model]}, {how}: {share(sum(bool(run.collides) for run in mine), len(mine))} collide")
    return Verdict(
        f"Planned paths are free of collisions ({words.RULES_WORD[rules]} rules)",
        "“collision-free” (abstract); no number at hand",
        f"{hits} of {len(solved)} paths truly collide, on all maps by all algorithms",
        UNDECIDED if not solved else HOLDS if hits == 0 else NOT,
        (
            "By coal at steps of 1/256 rad on true shapes, no margin. Algorithms often find the same path: counts are of rows, not of "
            "different paths."
        ),
        details,
    )


def _raw(run: Run, repeat: int, table: str) -> dict[str, Any]:
    variant, got = run.variant, run.answer
    return {
        "table": table,
        "row": variant.name,
        "rules": variant.rules,
        "model": variant.model,
        "search": variant.search,
        "smooth": variant.smooth,
        "question": run.question.index,
        "repeat": repeat,
        "outcome": got.outcome,
        "fell_back": got.fell_back,
        "n_neurons": len(got.neurons),
        "length_rad": got.length_rad,
        "collides": run.collides,
        **{f"{stage}_ms": value for stage, value in sorted(got.ms.items())},
    }
