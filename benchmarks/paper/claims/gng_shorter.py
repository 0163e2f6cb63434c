"""Claim: paths on a growing neural gas are shorter than on a gamma-SOM."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.paper import words
from benchmarks.paper.ask import RULES, Variant
from benchmarks.paper.claims.pairs import compare, holds_of, together
from benchmarks.paper.outcome import NOT_AT_HAND, Outcome, Table, Verdict
from benchmarks.paper.shared_runs import Run, scene_runs
from benchmarks.paper.stats import mean_sigma
from benchmarks.paper.study import MODELS, Study

__all__ = ["measure"]

INTRO = (
    "Both maps have the same number of neurons and the same training motions; Dijkstra plans on {n} scenes, by the paper's rules and by "
    "ours, raw and smoothed. Compared is the joint length of what would be driven, over the scenes that both solved."
)


def measure(study: Study) -> Outcome:
    """GNG against gamma-SOM, and SOM beside them."""
    runs = scene_runs(study, MODELS, ("dijkstra",))
    pairs = []
    for rules in RULES:
        for smooth in (False, True):
            a, b = (Variant(model, "dijkstra", smooth, rules) for model in ("gng", "gamma_som"))
            name = f"{words.RULES_WORD[rules]} rules, {'smoothed' if smooth else 'raw'}"
            pairs.append(compare(runs, a, b, lambda got: got.length_rad, name))
    verdict = Verdict(
        "GNG paths are shorter than γ-SOM paths",
        NOT_AT_HAND,
        ", ".join(f"{pair.ratio_word(2)} ({pair.name})" for pair in pairs) + ": median of GNG / γ-SOM",
        together([holds_of(pair) for pair in pairs]),
        "A lattice can only go along its rows, columns and diagonals; a gas has edges where motions were.",
        [pair.words("GNG shorter") for pair in pairs],
    )
    return Outcome(
        INTRO.format(n=study.scale.n_scenes),
        rows=[
            {
                "row": run.variant.name,
                "question": run.question.index,
                "solved": run.answer.solved,
                "length_rad": run.answer.length_rad,
                "n_neurons": len(run.answer.neurons),
            }
            for run in runs
        ],
        tables=[_table(runs)],
        verdicts=[verdict],
        data=pairs,
    )


def _table(runs: Sequence[Run]) -> Table:
    columns = ("rules", "model", "smoothed", "solved", "length, rad", "neurons")
    rows = []
    for variant in dict.fromkeys(run.variant for run in runs):
        solved = [run.answer for run in runs if run.variant == variant and run.answer.solved]
        head = words.row_head(variant)
        lengths, counts = [got.length_rad for got in solved], [float(len(got.neurons)) for got in solved]
        rows.append([head[0], head[1], head[3], str(len(solved)), mean_sigma(lengths), mean_sigma(counts, 1)])
    return Table("Path lengths by map", columns, rows, "mean ± σ over what each solved.")
