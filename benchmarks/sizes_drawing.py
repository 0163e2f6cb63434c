"""Draws how build time, bytes and answers grow with the map."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from benchmarks.paper.canvas import COLOURS, new_drawing, plain_log, plots, style

__all__ = ["draw"]

Row = dict[str, Any]
STAGES = {
    "motions": COLOURS["som"],
    "map": COLOURS["gng"],
    "prune": COLOURS["ompl_rrt"],
    "table": COLOURS["gamma_som"],
    "practice": COLOURS["checked"],
}
USUAL_NEURONS, USUAL_CELL_M = 10_000, 0.02
# The bounds for 100 000 neurons.
BUILD_S, TABLE_BYTES, REPLAN_MS = 1200.0, 1.5e9, 3.0
MB = 1e6


def draw(rows: Sequence[Row], png: Path) -> None:
    """Above over the number of neurons, below over the size of the cells: build time, bytes, replan time."""
    by_neurons = sorted((row for row in rows if row["cell_m"] == USUAL_CELL_M), key=lambda row: int(row["neurons"]))
    by_cells = sorted((row for row in rows if row["neurons"] == USUAL_NEURONS), key=lambda row: float(row["cell_m"]))
    lines = [part for part in ((by_neurons, "neurons", 1.0), (by_cells, "cm a cell", 100.0)) if len(part[0]) > 1] or [
        (list(rows), "neurons", 1.0)
    ]
    with style():
        drawing = new_drawing(11.5, 1.0 + 3.2 * len(lines))
        for axes, (chosen, label, factor) in zip(plots(drawing, len(lines), 3), lines, strict=True):
            x = [factor * row["cell_m" if factor > 1.0 else "neurons"] for row in chosen]
            for axis, fill in zip(axes, (_build, _bytes, _replan), strict=True):
                fill(axis, x, chosen)
                axis.set(xlabel=label, xscale="log", yscale="log")
                plain_log(axis.xaxis, x)
                if chosen is lines[0][0]:  # the lines below are the same
                    axis.legend(fontsize=8.0, ncols=2, loc="lower center", bbox_to_anchor=(0.5, 1.0))
        drawing.savefig(png)


def _lines(axis: Any, x: list[float], rows: Sequence[Row], of: dict[str, tuple[Callable[[Row], float], str, str]]) -> None:
    for label, (value, colour, mark) in of.items():
        axis.plot(x, [value(row) for row in rows], mark, color=colour, label=label)


def _bound(axis: Any, value: float, x: list[float]) -> None:
    """The issue's bound, over the largest map."""
    axis.plot([x[-1]], [value], "_", color=COLOURS["blocked"], markersize=16.0, markeredgewidth=2.0, label="bound at 100 000 neurons")


def _build(axis: Any, x: list[float], rows: Sequence[Row]) -> None:
    _lines(axis, x, rows, {"build": (lambda row: row["build_s"]["total"], COLOURS["path"], "o-")})
    for stage, colour in STAGES.items():
        axis.plot(x, [row["build_s"][stage] for row in rows], "o--", color=colour, label=stage, linewidth=1.0, markersize=3.0)
    if rows[-1]["neurons"] > USUAL_NEURONS:
        _bound(axis, BUILD_S, x)
    axis.set(ylabel="s")


def _bytes(axis: Any, x: list[float], rows: Sequence[Row]) -> None:
    of = {
        "table and layers": (lambda row: (row["table_bytes"] + row["layer_bytes"]) / MB, COLOURS["path"], "o-"),
        "table of cells": (lambda row: row["table_bytes"] / MB, COLOURS["gng"], "o--"),
        "layers of clearance": (lambda row: row["layer_bytes"] / MB, COLOURS["checked"], "o--"),
        "memory of a planner": (lambda row: row["planner_bytes"] / MB, COLOURS["som"], "o:"),
    }
    _lines(axis, x, rows, of)
    if rows[-1]["neurons"] > USUAL_NEURONS:
        _bound(axis, TABLE_BYTES / MB, x)
    axis.set(ylabel="MB")


def _replan(axis: Any, x: list[float], rows: Sequence[Row]) -> None:
    for name, label, colour in (("connect_search", "connect and search", COLOURS["gng"]), ("answer", "answer", COLOURS["checked"])):
        solved = [(at, row[f"{name}_ms"]) for at, row in zip(x, rows, strict=True) if f"{name}_ms" in row]
        for percentile, mark in (("p50", "o-"), ("p95", "o--"), ("p99", "o:")):
            axis.plot([at for at, _ in solved], [ms[percentile] for _, ms in solved], mark, color=colour, label=f"{label}, {percentile}")
    if rows[-1]["neurons"] > USUAL_NEURONS:
        _bound(axis, REPLAN_MS, x)
    axis.set(ylabel="ms")
