"""Claim: the resolution of paths (joint step between neurons) follows the size of the network."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.paper.ask import Variant, answer
from benchmarks.paper.outcome import HOLDS, IN_PART, NOT, NOT_AT_HAND, UNDECIDED, Holds, Outcome, Table, Verdict
from benchmarks.paper.stats import mean_sigma, median, percentile, share
from benchmarks.paper.study import Study

__all__ = ["Size", "measure"]

INTRO = (
    "Growing neural gases of several sizes on the same training motions, asked the same {n} questions. *Step*: joint distance between "
    "neighbouring neurons on raw paths (Dijkstra, paper's rules). *Solved*: by our rules, smoothed."
)


@dataclass(frozen=True)
class Size:
    """One size: lengths in rad, times in ms, over its answers."""

    n_neurons: int
    edge_median_rad: float
    quantisation_error_rad: float
    steps_rad: tuple[float, ...]
    n_solved: int
    n_asked: int
    search_ms: tuple[float, ...]
    smoothed_rad: tuple[float, ...]


def measure(study: Study) -> Outcome:
    """Every size on the same questions."""
    sizes = [_size(study, n) for n in study.scale.network_sizes]
    steps = [float(np.median(s.steps_rad)) if s.steps_rad else float("nan") for s in sizes]
    slope = _slope([s.n_neurons for s in sizes], steps)
    said = ", ".join(f"{step:.3f} rad at {s.n_neurons}" for step, s in zip(steps, sizes, strict=True))
    verdict = Verdict(
        "A larger network gives finer paths",
        NOT_AT_HAND,
        f"median step {said}; step ~ neurons^{slope:.2f}",
        _holds(steps),
        (f"Data that filled d dimensions evenly would give an exponent of −1/d; this one stands for about {_dimension(slope)} dimensions."),
    )
    raw = [
        {
            "row": f"gng-{s.n_neurons}",
            "n_neurons": s.n_neurons,
            "edge_median_rad": s.edge_median_rad,
            "quantisation_error_rad": s.quantisation_error_rad,
            "step_median_rad": step,
            "n_solved": s.n_solved,
            "n_asked": s.n_asked,
        }
        for s, step in zip(sizes, steps, strict=True)
    ]
    intro = INTRO.format(n=study.scale.n_size_scenes)
    return Outcome(intro, rows=raw, tables=[_table(sizes)], verdicts=[verdict], data=sizes)


def _table(sizes: Sequence[Size]) -> Table:
    rows = [
        [
            f"{s.n_neurons:,}".replace(",", " "),
            f"{s.edge_median_rad:.3f}",
            f"{s.quantisation_error_rad:.3f}",
            f"{median(s.steps_rad, 3)} / {percentile(s.steps_rad, 95, 3)}",
            share(s.n_solved, s.n_asked),
            mean_sigma(s.smoothed_rad),
            median(s.search_ms, 3),
        ]
        for s in sizes
    ]
    columns = (
        "neurons",
        "edge median, rad",
        "quantisation error, rad",
        "step median / p95, rad",
        "solved",
        "smoothed length, rad",
        "search median, ms",
    )
    return Table("Size and resolution", columns, rows)


def _size(study: Study, n_neurons: int) -> Size:
    parts, scenes = study.sized(n_neurons), study.scenes(study.scale.n_size_scenes)
    planner = parts.motion_planner()
    steps: list[float] = []
    smoothed, search_ms = [], []
    for question in study.shown(scenes, f"{n_neurons} neurons", len(scenes)):
        raw = answer(parts, planner, question, Variant("gng", "dijkstra", False, "paper"))
        if raw.solved:
            steps += np.linalg.norm(np.diff(parts.roadmap.neurons_rad[raw.neurons], axis=0), axis=1).tolist()
            search_ms.append(raw.ms["search"])
        ours = answer(parts, planner, question, Variant("gng", "dijkstra", True, "checked"))
        smoothed += [ours.length_rad] if ours.solved else []
    figures = parts.built.figures
    edge = float(np.median(np.linalg.norm(np.diff(parts.roadmap.neurons_rad[parts.roadmap.edges], axis=1)[:, 0], axis=1)))
    error = float(figures["quantisation_error_rad"])
    return Size(parts.roadmap.n_neurons, edge, error, tuple(steps), len(smoothed), len(scenes), tuple(search_ms), tuple(smoothed))


def _slope(sizes: list[int], steps: list[float]) -> float:
    """Exponent of step ~ neurons^slope, least squares in logarithms; NaN if there are fewer than two points."""
    good = np.isfinite(steps)
    if good.sum() < 2:
        return float("nan")
    return float(np.polyfit(np.log(np.array(sizes)[good]), np.log(np.array(steps)[good]), 1)[0])


def _dimension(slope: float) -> str:
    return f"{-1.0 / slope:.1f}" if slope < 0.0 else "no number of"


def _holds(steps: list[float]) -> Holds:
    """Each size finer than the one before."""
    if len(steps) < 2 or not np.all(np.isfinite(steps)):
        return UNDECIDED
    finer = np.diff(steps) < 0.0
    return HOLDS if finer.all() else IN_PART if steps[-1] < steps[0] else NOT
