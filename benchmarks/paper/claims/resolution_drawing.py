"""Draws step and solved share against the size of the network."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.paper.canvas import COLOURS, new_drawing, plain_log, plots, save
from benchmarks.paper.claims.resolution import Size
from benchmarks.paper.outcome import Figure, Outcome

__all__ = ["draw"]

CAPTION = "Left: joint step between neurons on paths (median, band: 5 to 95 %) and median edge. Right: questions solved by our rules."


def draw(outcome: Outcome, folder: Path) -> Sequence[Figure]:
    """Two panels over the number of neurons."""
    sizes: list[Size] = [size for size in outcome.data if size.steps_rad]
    drawing = new_drawing(9.0, 3.3)
    left, right = plots(drawing, 1, 2)[0]
    n = [size.n_neurons for size in sizes]
    low, middle, high = np.array([np.percentile(size.steps_rad, [5, 50, 95]) for size in sizes]).reshape(-1, 3).T
    left.fill_between(n, low, high, color=COLOURS["gng"], alpha=0.15, linewidth=0)
    left.plot(n, middle, "o-", color=COLOURS["gng"], label="step on paths")
    left.plot(n, [size.edge_median_rad for size in sizes], "s--", color=COLOURS["som"], label="edge of the map")
    left.set(xscale="log", yscale="log", xlabel="neurons", ylabel="rad")
    plain_log(left.yaxis, [0.1, 0.2, 0.3, 0.5, 0.8, 1.2, 2.0])
    left.legend()
    right.plot(n, [100.0 * size.n_solved / size.n_asked for size in sizes], "o-", color=COLOURS["checked"])
    right.set(xscale="log", xlabel="neurons", ylabel="solved, %", ylim=(0.0, 102.0))
    for axes in (left, right):
        plain_log(axes.xaxis, n)
    return [save(drawing, folder, "resolution", CAPTION)]
