"""Draws the photo series of a dodge, and keeps its data beside the report."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.paper.canvas import new_drawing, save
from benchmarks.paper.figures.dodge import Series, record_path
from benchmarks.paper.figures.dodge_record import write_dodge
from benchmarks.paper.outcome import Figure, Outcome
from clients.demo.picture import draw_into

__all__ = ["draw"]

COLUMNS = 3
OVERLAP = 0.06  # of the drawing's width or height, by which neighbouring photos overlap: 3-D axes leave wide margins
CAPTION = (
    "One dodge in the running stack: cells seen by the cameras yellow, planned path green, driven path cyan; seconds after the new way "
    "came."
)


def draw(outcome: Outcome, folder: Path) -> Sequence[Figure]:
    """Six photos in two rows; nothing if no dodge was seen."""
    series: Series = outcome.data
    if series.dodge is None:
        return []
    write_dodge(series.dodge, record_path(folder.parent))
    rows = -(-len(series.dodge.photos) // COLUMNS)
    drawing = new_drawing(12.0, 2.95 * rows, layout=None)
    width, height = 1.0 / COLUMNS, 1.0 / rows
    for k, (at_s, photo) in enumerate(zip(series.dodge.at_s, series.dodge.photos, strict=True)):
        row, column = divmod(k, COLUMNS)
        left, bottom = column * width - OVERLAP, 1.0 - (row + 1) * height - OVERLAP
        place = (left, bottom, width + 2.0 * OVERLAP, height + 2.0 * OVERLAP)
        axes: Any = drawing.add_axes(place, projection="3d", computed_zorder=False)
        axes.patch.set_visible(False)
        draw_into(axes, photo, series.arm, series.fixed)
        for collection in axes.collections:
            collection.set_rasterized(True)  # tens of thousands of triangles: no vectors
        axes.text2D(0.17, 0.8, f"{at_s:+.2f} s", transform=axes.transAxes, fontsize=12)
    return [save(drawing, folder, "dodge", CAPTION)]
