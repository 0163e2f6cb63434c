"""Draws the two-link example: the plane with its cells, and the map with what the obstacle blocks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.patches import Rectangle

from benchmarks.paper.canvas import COLOURS, new_drawing, plots, save
from benchmarks.paper.figures.two_link import SIDE, Example
from benchmarks.paper.outcome import Figure, Outcome

__all__ = ["draw"]

ROW_CELL = (15, 15)  # the cell whose row of the table is shown
CAPTION = (
    "Left: the plane in cells; the obstacle red, one of its cells (outlined) read in the table; the arm along the path round it, from "
    "light to dark. Middle: that cell's row of the table, the neurons whose arm sweeps it. Right: the neurons that all nine cells block "
    "(red) and the paths in the map before (dashed) and after the obstacle came (blue)."
)


def draw(outcome: Outcome, folder: Path) -> Sequence[Figure]:
    """One figure of three panels."""
    e: Example = outcome.data
    drawing = new_drawing(11.5, 4.0)
    plane, row, whole = plots(drawing, 1, 3, width_ratios=(1.5, 1.0, 1.0))[0]
    _draw_plane(plane, e)
    x, y = ROW_CELL
    one = np.zeros(len(e.neurons_rad), dtype=bool)
    one[e.table[x * e.arm.n_cells + y]] = True
    _draw_map(row, e, one, f"one cell's row: {int(one.sum())} neurons")
    _draw_map(whole, e, e.blocked, f"all {len(e.occupied)} cells: {int(e.blocked.sum())} of {len(e.blocked)} neurons")
    for path, style, colour in ((e.direct, "--", COLOURS["paper"]), (e.path, "-", COLOURS["path"])):
        q = np.degrees(e.neurons_rad[path])
        whole.plot(q[:, 1], q[:, 0], style, color=colour, linewidth=1.8)
    return [save(drawing, folder, "two-link", CAPTION)]


def _draw_plane(axes: Any, e: Example) -> None:
    cell_m = 2.0 * e.arm.half_m / e.arm.n_cells
    for cell in e.occupied:
        x, y = divmod(int(cell), e.arm.n_cells)
        corner = (x * cell_m - e.arm.half_m, y * cell_m - e.arm.half_m)
        axes.add_patch(Rectangle(corner, cell_m, cell_m, facecolor=COLOURS["blocked"], edgecolor="white", linewidth=0.5, zorder=2))
        if (x, y) == ROW_CELL:
            axes.add_patch(Rectangle(corner, cell_m, cell_m, facecolor="none", edgecolor="black", linewidth=1.8, zorder=4))
    shown = e.path[:: max(1, len(e.path) // 9)] + e.path[-1:]
    for k, neuron in enumerate(shown):
        points = e.arm.points(e.neurons_rad[neuron])
        axes.plot(*points.T, color=COLOURS["path"], alpha=0.2 + 0.8 * k / max(1, len(shown) - 1), linewidth=2.2, zorder=3)
    ticks = np.linspace(-e.arm.half_m, e.arm.half_m, e.arm.n_cells + 1)
    axes.set_xticks(ticks, minor=True)
    axes.set_yticks(ticks, minor=True)
    axes.grid(visible=True, which="minor", linewidth=0.4)
    axes.grid(visible=False, which="major")
    axes.tick_params(which="minor", length=0)
    axes.set(xlim=(-e.arm.half_m, e.arm.half_m), ylim=(-0.4, e.arm.half_m), xlabel="x, m", ylabel="y, m", aspect="equal", title="the plane")


def _draw_map(axes: Any, e: Example, red: Any, title: str) -> None:
    q = np.degrees(e.neurons_rad)
    axes.scatter(q[:, 1], q[:, 0], s=2400.0 / SIDE, marker="s", color=np.where(red, COLOURS["blocked"], "#dfe4ea"), linewidths=0)
    axes.set(xlabel="elbow, degrees", ylabel="shoulder, degrees", title=title)
    axes.grid(visible=False)
