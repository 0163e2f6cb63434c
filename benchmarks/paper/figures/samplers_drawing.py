"""Draws the runs of the sampling planners in space."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from benchmarks.paper import words
from benchmarks.paper.canvas import COLOURS, add_boxes, limits_of, new_drawing, save, space_axes
from benchmarks.paper.figures.samplers import Ways
from benchmarks.paper.outcome import Figure, Outcome
from benchmarks.paper.table2 import PLANNERS

__all__ = ["draw"]

CAPTION = (
    "Tool paths of the sampling planners, thin, and ours, bold blue, among the boxes of the question (red). Above raw, below simplified."
)


def draw(outcome: Outcome, folder: Path) -> Sequence[Figure]:
    """One figure: planners side by side, raw above simplified."""
    ways: Ways = outcome.data
    drawing = new_drawing(11.5, 7.6)
    limits_m = limits_of([ways.boxes_m, ways.ours_m, *(way for found in ways.samplers_m.values() for way in found)])
    grid = drawing.add_gridspec(2, len(PLANNERS))
    for row, how in enumerate(("raw", "simplified")):
        for column, planner in enumerate(PLANNERS):
            axes = space_axes(drawing, grid[row, column], f"{words.PEER[planner]}, {how}", limits_m)
            add_boxes(axes, ways.boxes_m, COLOURS["blocked"], 0.35)
            for way in ways.samplers_m[f"{planner}-{how}"]:
                axes.plot(*way.T, color=COLOURS[planner], linewidth=1.0, alpha=0.8, zorder=3)
            if len(ways.ours_m):
                axes.plot(*ways.ours_m.T, color=COLOURS["path"], linewidth=2.8, zorder=4)
    return [save(drawing, folder, "samplers", CAPTION)]
