"""Draws what each map solves and what it took to train."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.paper.canvas import COLOURS, new_drawing, plots, save
from benchmarks.paper.claims.extension import Learned
from benchmarks.paper.outcome import Figure, Outcome

__all__ = ["draw"]


def draw(outcome: Outcome, folder: Path) -> Sequence[Figure]:
    """Solved left, seconds right."""
    learned: list[Learned] = outcome.data
    drawing = new_drawing(9.5, 2.9)
    left, right = plots(drawing, 1, 2, sharey=True)[0]
    y = np.arange(len(learned))
    for shift, label, colour in ((-0.18, "old task", COLOURS["som"]), (0.18, "new task", COLOURS["gng"])):
        solved = [k.n_old if label == "old task" else k.n_new for k in learned]
        left.barh(y + shift, [100.0 * s / k.n_asked for s, k in zip(solved, learned, strict=True)], height=0.34, color=colour, label=label)
    right.barh(y, [k.training_s for k in learned], height=0.5, color=COLOURS["gamma_som"])
    left.set_yticks(y, [k.name for k in learned])
    left.invert_yaxis()
    left.set(xlabel="solved, %", xlim=(0.0, 100.0))
    right.set(xlabel="training, s")
    for axes in (left, right):
        axes.grid(visible=False, axis="y")
    left.legend(fontsize=9, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
    return [save(drawing, folder, "extension", "What each map solves of both tasks, and the seconds of its training.")]
