"""One look for all figures, and both files of each."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Drawing
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import NDArray

from benchmarks.paper.outcome import Figure
from common.robot.solids import box_mesh

__all__ = ["COLOURS", "add_boxes", "limits_of", "new_drawing", "plain_log", "plots", "save", "space_axes", "style"]

F64 = NDArray[np.float64]
Limits = tuple[tuple[float, float], ...]
DPI = 130  # sharp on a screen, about 100 kB a figure
TICK_M = 0.2
COLOURS = {
    "gng": "#1d5f9e",
    "gamma_som": "#c2571a",
    "som": "#7a7f87",
    "ompl_prm": "#8a5fb0",
    "ompl_rrt": "#b98a00",
    "ompl_rrt_connect": "#b3261e",
    "blocked": "#d6433a",
    "free": "#eef1f4",
    "path": "#1747d1",
    "paper": "#5b6675",
    "checked": "#2e7d4f",
}
STYLE = {
    "font.size": 10.0,
    "font.family": "DejaVu Sans",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e3e7ec",
    "grid.linewidth": 0.8,
    "axes.axisbelow": True,
    "axes.titlesize": 10.5,
    "legend.frameon": False,
    "savefig.bbox": "tight",
    "savefig.pad_inches": 0.08,
    "svg.hashsalt": "tolman",  # equal figures are equal bytes
}


def style() -> AbstractContextManager[None]:
    """Within it everything is drawn in the common style."""
    return mpl.rc_context(STYLE)


def new_drawing(width_in: float, height_in: float, layout: Literal["constrained"] | None = "constrained") -> Drawing:
    """An empty drawing, laid out without overlaps unless its axes are placed by hand (None)."""
    drawing = Drawing(figsize=(width_in, height_in), dpi=DPI, layout=layout)
    FigureCanvasAgg(drawing)
    return drawing


def plots(drawing: Drawing, rows: int, columns: int, **options: Any) -> Any:
    """(rows, columns) array of axes."""
    return drawing.subplots(rows, columns, squeeze=False, **options)


def plain_log(axis: Any, ticks: Sequence[float]) -> None:
    """A logarithmic axis with these ticks, written as plain numbers."""
    axis.set_major_locator(FixedLocator(list(ticks)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def save(drawing: Drawing, folder: Path, stem: str, caption: str) -> Figure:
    """Write ``<stem>.png`` and ``<stem>.svg``."""
    folder.mkdir(parents=True, exist_ok=True)
    drawing.savefig(folder / f"{stem}.png")
    drawing.savefig(folder / f"{stem}.svg", metadata={"Date": None})
    return Figure(stem, caption)


def limits_of(points_m: Sequence[F64]) -> Limits:
    """Lowest and highest x, y, z of points (..., 3) in metres with some room, rounded to ticks; z from the table up."""
    every = np.vstack([np.asarray(points).reshape(-1, 3) for points in points_m])
    low, high = np.floor(every.min(axis=0) / TICK_M * 2.0) * TICK_M / 2.0, np.ceil(every.max(axis=0) / TICK_M * 2.0) * TICK_M / 2.0
    low[2] = min(low[2], 0.0)
    return tuple((float(a), float(b)) for a, b in zip(low, high, strict=True))


def space_axes(drawing: Drawing, place: Any, title: str, limits_m: Limits) -> Any:
    """3-D axes in metres, equal scales, seen from the front right."""
    axes: Any = drawing.add_subplot(place, projection="3d", computed_zorder=False)
    axes.patch.set_visible(False)  # it would cover the neighbour's label
    axes.set(xlim=limits_m[0], ylim=limits_m[1], zlim=limits_m[2], xlabel="x, m", ylabel="y, m", zlabel="z, m")
    axes.set_box_aspect([high - low for low, high in limits_m], zoom=1.0)
    axes.view_init(elev=24.0, azim=-28.0)
    axes.set_title(title, y=1.0)
    axes.tick_params(labelsize=7, pad=0)
    axes.set(xticks=_ticks(limits_m[0]), yticks=_ticks(limits_m[1]), zticks=_ticks(limits_m[2]))
    axes.zaxis.labelpad = -2.0
    return axes


def _ticks(limits_m: tuple[float, float]) -> F64:
    return np.arange(np.ceil(limits_m[0] / TICK_M), np.floor(limits_m[1] / TICK_M) + 1) * TICK_M


def add_boxes(axes: Any, boxes_m: F64, colour: str, alpha: float) -> None:
    """Boxes (n, 2, 3: lowest and highest corners in metres) as solids."""
    for low, high in boxes_m:
        vertices, triangles = box_mesh(list(high - low))
        corners = (vertices + (low + high) / 2.0)[triangles]
        axes.add_collection3d(Poly3DCollection(corners, facecolors=colour, alpha=alpha, edgecolors="none", zorder=1))
