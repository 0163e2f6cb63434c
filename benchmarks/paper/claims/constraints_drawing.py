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
    "Share of plans whose largest tilt stays below a bound, on the map that learned such motions (blue) and on the shipped one (orange). "
    "The grey line is what we call kept."
)


def draw(outcome: Outcome, folder: Path) -> Sequence[Figure]:
    """A row for each direction of the tool, a panel for each way of planning."""
    found: list[Tilts] = outcome.data
    hows, leans = (list(dict.fromkeys(values)) for values in ([t.how for t in found], [t.lean_deg for t in found]))
    drawing = new_drawing(11.5, 2.7 * len(leans))
    panels = plots(drawing, len(leans), len(hows), sharey=True)
    for row, lean_deg in enumerate(leans):
        for axes, how in zip(panels[row], hows, strict=True):
            for tilts in (t for t in found if (t.how, t.lean_deg) == (how, lean_deg) and t.worst_deg):
                worst = np.sort(tilts.worst_deg)
                shares = np.arange(len(worst) + 1) / len(worst)
                axes.step([0.0, *worst], shares, where="post", color=COLOUR[tilts.map_name], linewidth=1.9, label=tilts.map_name)
            axes.axvline(KEPT_DEG, color=COLOURS["paper"], linewidth=1.0)
            axes.set(title=f"{how}, lean {lean_deg:.0f}°", ylim=(0.0, 1.02), xlim=(-2.0, None))
        panels[row, 0].set_ylabel("share of plans")
    for axes in panels[-1]:
        axes.set_xlabel("largest tilt of a plan, °")
    panels[0, -1].legend(loc="lower right")
    return [save(drawing, folder, "constraints", CAPTION)]
