"""Draws where the milliseconds go."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.paper import words
from benchmarks.paper.ask import RULES
from benchmarks.paper.canvas import new_drawing, plots, save
from benchmarks.paper.claims.smoothing_cost import STAGES
from benchmarks.paper.outcome import Figure, Outcome

__all__ = ["draw"]

SHADES = {"update": "#9fb4c9", "search": "#1d5f9e", "smooth": "#c2571a", "time": "#c9cdd3", "verify": "#e0a06f"}


def draw(outcome: Outcome, folder: Path) -> Sequence[Figure]:
    """One bar for each set of rules, stages side by side."""
    drawing = new_drawing(8.5, 2.2)
    axes = plots(drawing, 1, 1)[0, 0]
    left = np.zeros(len(RULES))
    for stage in STAGES:
        width = np.array([float(np.mean(outcome.data[rules][stage] or [0.0])) for rules in RULES])
        axes.barh([words.RULES_WORD[rules] for rules in RULES], width, left=left, color=SHADES[stage], label=stage, height=0.55)
        left += width
    axes.invert_yaxis()
    axes.set(xlabel="mean milliseconds of an answer")
    axes.grid(visible=False, axis="y")
    axes.legend(ncols=len(STAGES), loc="lower left", bbox_to_anchor=(0.0, 1.0), fontsize=9)
    return [save(drawing, folder, "smoothing-cost", "Where the time of an answer goes: GNG, Dijkstra, smoothed. Orange shades: smoothing.")]
