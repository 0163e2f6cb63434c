"""Draws the lengths of all runs: one mark a run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.paper.canvas import COLOURS, new_drawing, plots, save
from benchmarks.paper.outcome import Figure, Outcome
from benchmarks.paper.table2 import name_of

__all__ = ["draw"]


def draw(outcome: Outcome, folder: Path) -> Sequence[Figure]:
    """A line of marks for each way of planning."""
    lengths: dict[str, list[float]] = outcome.data
    drawing = new_drawing(9.0, 0.42 * len(lengths) + 1.0)
    axes = plots(drawing, 1, 1)[0, 0]
    for k, (name, values) in enumerate(lengths.items()):
        colour = COLOURS["gng"] if name.startswith("gng") else COLOURS[name.partition("-")[0]]
        axes.plot(values, np.full(len(values), k), "|", color=colour, markersize=15, markeredgewidth=1.6)
    axes.set_yticks(range(len(lengths)), [name_of(name) for name in lengths])
    axes.invert_yaxis()
    axes.set(xlabel="joint length of the path, rad", xlim=(0.0, None))
    return [save(drawing, folder, "reproducible", "Every run of the same question is one mark: ours fall on one another.")]
