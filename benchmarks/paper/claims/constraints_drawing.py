"""Draws the tilt of the tool along all plans."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.paper.canvas import COLOURS, new_drawing, plots, save
from benchmarks.paper.claims.constraints import KEPT_DEG, Tilts
from benchmarks.paper.outcome import Figure, Outcome

__all__ = ["draw"]

COLOUR = {"constrained": COLOURS["gng"], "unconstrained": COLOURS["gamma_som"]}
CAPTION = (
    "Share of plans whose largest tilt stays below a bound, on the map that learned upright motions (blue) and on the shipped "
    "one (orange). The grey line is what "
    "we call kept."
)


def draw(outcome: Outcome, folder: Path) -> Sequence[Figure]:
    """A panel for each way of planning."""
    found: list[Tilts] = outcome.data
    hows = list(dict.fromkeys(t.how for t in found))
    drawing = new_drawing(11.5, 3.2)
    for axes, how in zip(plots(drawing, 1, len(hows), sharey=True)[0], hows, strict=True):
        for tilts in (t for t in found if t.how == how and t.worst_deg):
            worst = np.sort(tilts.worst_deg)
            axes.step(
                [0.0, *worst],
                np.arange(len(worst) + 1) / len(worst),
                where="post",
                color=COLOUR[tilts.map_name],
                linewidth=1.9,
                label=tilts.map_name,
            )
        axes.axvline(KEPT_DEG, color=COLOURS["paper"], linewidth=1.0)
        axes.set(xlabel="largest tilt of a plan, °", title=how, ylim=(0.0, 1.02), xlim=(0.0, None))
    axes.legend(loc="lower right")
    return [save(drawing, folder, "constraints", CAPTION)]
