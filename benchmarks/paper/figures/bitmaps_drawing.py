"""Draws the bitmaps and the ways of the tool."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from benchmarks.paper import words
from benchmarks.paper.canvas import COLOURS, add_boxes, limits_of, new_drawing, save, space_axes
from benchmarks.paper.figures.bitmaps import Bitmap, Maps
from benchmarks.paper.outcome import Figure, Outcome

__all__ = ["draw"]

CAPTION = (
    "Cognitive maps among the boxes of the question: blocked neurons red, path blue (start: circle, goal: square). Left: neurons of the "
    "raw path. Middle: best matches along the smoothed curve; where no smoothed curve has free best matches it is rejected, and the best "
    "matches along the raw path are shown. Right: the tool's way in space, raw thin and smoothed bold."
)


def draw(outcome: Outcome, folder: Path) -> Sequence[Figure]:
    """One figure: a row for each map."""
    maps: Maps = outcome.data
    drawing = new_drawing(11.5, 3.9 * len(maps.bitmaps))
    limits_m = limits_of([maps.boxes_m, *(way for bitmap in maps.bitmaps for way in (bitmap.raw_m, bitmap.smoothed_m))])
    grid = drawing.add_gridspec(len(maps.bitmaps), 3, width_ratios=(1.0, 1.0, 1.15))
    for k, bitmap in enumerate(maps.bitmaps):
        for column, (path, how) in enumerate(
            ((bitmap.raw, "raw"), (bitmap.smoothed, "smoothing rejected" if bitmap.rejected else "smoothed"))
        ):
            _draw_bitmap(drawing.add_subplot(grid[k, column]), bitmap, path, how)
        axes = space_axes(drawing, grid[k, 2], f"{words.MODEL[bitmap.model]}: way of the tool", limits_m)
        add_boxes(axes, maps.boxes_m, COLOURS["blocked"], 0.35)
        for way, width, alpha in ((bitmap.raw_m, 1.2, 0.8), (bitmap.smoothed_m, 2.6, 1.0)):
            if len(way):
                axes.plot(*way.T, color=COLOURS["path"], linewidth=width, alpha=alpha, zorder=4)
                axes.plot(*way[:1].T, "o", color=COLOURS["path"], markersize=5, zorder=5)
                axes.plot(*way[-1:].T, "s", color=COLOURS["path"], markersize=5, zorder=5)
    return [save(drawing, folder, "bitmaps", CAPTION)]


def _draw_bitmap(axes: Any, bitmap: Bitmap, path: NDArray[np.int32], how: str) -> None:
    image = np.ones((bitmap.side, bitmap.side, 3))
    image[tuple(bitmap.place.T)] = to_rgb(COLOURS["free"])
    image[tuple(bitmap.place[bitmap.blocked].T)] = to_rgb(COLOURS["blocked"])
    image[tuple(bitmap.place[path].T)] = to_rgb(COLOURS["path"])
    axes.imshow(image, interpolation="nearest")
    way = bitmap.place[path]
    if len(way):
        axes.plot(way[:, 1], way[:, 0], color=COLOURS["path"], linewidth=0.7, alpha=0.55)
        axes.plot(way[:, 1], way[:, 0], "s", color=COLOURS["path"], markersize=2.4)
        for point, mark in ((way[0], "o"), (way[-1], "s")):
            axes.plot(point[1], point[0], mark, markersize=8, markerfacecolor="none", markeredgecolor=COLOURS["path"], markeredgewidth=1.6)
    axes.set_title(f"{words.MODEL[bitmap.model]}, {how}: {len(way)} neurons")
    axes.set(xticks=[], yticks=[])
    axes.grid(visible=False)
    axes.spines[:].set_visible(True)
