"""Claim: Dijkstra's paths are shorter in joint space than the wavefront's, though they pass more neurons."""

from __future__ import annotations

from benchmarks.paper import words
from benchmarks.paper.ask import Variant
from benchmarks.paper.claims.pairs import Pair, compare, holds_of, together
from benchmarks.paper.outcome import HOLDS, IN_PART, NOT, NOT_AT_HAND, UNDECIDED, Holds, Outcome, Table, Verdict
from benchmarks.paper.shared_runs import scene_runs
from benchmarks.paper.stats import mean_sigma
from benchmarks.paper.study import MODELS, Study

__all__ = ["measure"]

INTRO = (
    "The wavefront finds the path of fewest neurons, Dijkstra the shortest one. Both plan on each map on {n} scenes, raw, by the paper's "
    "rules; compared over the scenes that both solved."
)


def measure(study: Study) -> Outcome:
    """Lengths and numbers of neurons, on each map."""
    runs = scene_runs(study, MODELS, ("dijkstra", "wavefront"))
    lengths, counts, rows = [], [], []
    for model in MODELS:
        dijkstra, wavefront = (Variant(model, search, False, "paper") for search in ("dijkstra", "wavefront"))
        length = compare(runs, dijkstra, wavefront, lambda got: got.length_rad, words.MODEL[model])
        count = compare(runs, dijkstra, wavefront, lambda got: float(len(got.neurons)), words.MODEL[model])
        lengths.append(length)
        counts.append(count)
        rows.append([words.MODEL[model], str(len(length.a)), *(mean_sigma(values) for values in (length.a, length.b, count.a, count.b))])
    shorter, more = together([holds_of(pair) for pair in lengths]), together([_more(pair) for pair in counts])
    verdict = Verdict(
        "Dijkstra is shorter in joint space than the wavefront, though it passes more neurons",
        NOT_AT_HAND,
        ", ".join(f"{pair.ratio_word(3)} ({pair.name})" for pair in lengths) + ": median of Dijkstra / wavefront",
        HOLDS if shorter == more == HOLDS else NOT if shorter == NOT else UNDECIDED if shorter == UNDECIDED else IN_PART,
        "Where both find a path of equally few neurons, only the lengths differ.",
        [f"{a.words('shorter')}; neurons {mean_sigma(b.a, 1)} against {mean_sigma(b.b, 1)}" for a, b in zip(lengths, counts, strict=True)],
    )
    columns = ("model", "scenes", "Dijkstra, rad", "wavefront, rad", "Dijkstra, neurons", "wavefront, neurons")
    raw = [
        {"row": r.variant.name, "question": r.question.index, "length_rad": r.answer.length_rad, "n_neurons": len(r.answer.neurons)}
        for r in runs
        if r.variant.rules == "paper" and not r.variant.smooth
    ]
    table = Table("Dijkstra beside the wavefront", columns, rows, "mean ± σ over scenes that both solved.")
    return Outcome(INTRO.format(n=study.scale.n_scenes), rows=raw, tables=[table], verdicts=[verdict], data=lengths)


def _more(pair: Pair) -> Holds:
    """Whether Dijkstra passes more neurons in some scene; it can never pass fewer."""
    if not pair.a:
        return UNDECIDED
    return HOLDS if sum(pair.a) > sum(pair.b) else NOT
