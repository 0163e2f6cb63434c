"""Draws solved share and time over clutter and over the width of the gap."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.paper.canvas import COLOURS, new_drawing, plain_log, plots, save
from benchmarks.paper.claims.clutter import PEER, WAYS, Try, way_name
from benchmarks.paper.outcome import Figure, Outcome

__all__ = ["draw"]

COLOUR = {"gng-paper": COLOURS["paper"], "gng-checked": COLOURS["gng"], PEER: COLOURS[PEER]}


def draw(outcome: Outcome, folder: Path) -> Sequence[Figure]:
    """Solved above, median time below; clutter left, gap right."""
    tries: list[Try] = outcome.data
    drawing = new_drawing(9.5, 5.2)
    panels = plots(drawing, 2, 2)
    for column, (kind, label, factor) in enumerate((("boxes", "boxes", 1.0), ("gap", "gap, cm", 100.0))):
        levels = sorted({t.level for t in tries if t.kind == kind})
        for way in WAYS:
            groups = [[t for t in tries if (t.kind, t.level, t.way) == (kind, level, way)] for level in levels]
            x = factor * np.array(levels)
            solved = [100.0 * np.mean([t.solved for t in group]) for group in groups]
            panels[0, column].plot(x, solved, "o-", color=COLOUR[way], label=way_name(way))
            times = [np.median([t.ms for t in group if t.solved] or [np.nan]) for group in groups]
            panels[1, column].plot(x, times, "o-", color=COLOUR[way])
        panels[0, column].set(ylim=(-2.0, 102.0), xlabel=label, ylabel="solved, %")
        panels[1, column].set(yscale="log", xlabel=label, ylabel="median answer, ms")
        plain_log(panels[1, column].yaxis, [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0])
    panels[0, 0].legend(fontsize=9)
    caption = "Share solved and median time: boxes about the way (left) and a gap to reach into (right)."
    return [save(drawing, folder, "clutter", caption)]
