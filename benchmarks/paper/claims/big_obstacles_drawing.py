"""Draws how maps fail as the cube grows."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.paper import words
from benchmarks.paper.ask import RULES
from benchmarks.paper.canvas import COLOURS, new_drawing, plots, save
from benchmarks.paper.claims.big_obstacles import EDGES_M, Fall
from benchmarks.paper.outcome import Figure, Outcome
from benchmarks.paper.study import MODELS

__all__ = ["draw", "failed_share"]

CAPTION = (
    "Left and middle: share of scenes in which a map has failed, against the edge of the cube; scenes that ended without a failure leave "
    "the count from there on (Kaplan-Meier). Right: share of blocked neurons at the first failure, by the paper's rules."
)


def failed_share(falls: Sequence[Fall]) -> list[float]:
    """For each edge of the cube: share of scenes failed by then (Kaplan-Meier)."""
    alive, shares = 1.0, []
    for edge_m in EDGES_M:
        at_risk = sum(fall.edge_m >= edge_m for fall in falls)
        failed = sum(fall.failed and fall.edge_m == edge_m for fall in falls)
        alive *= 1.0 - failed / at_risk if at_risk else 1.0
        shares.append(1.0 - alive)
    return shares


def draw(outcome: Outcome, folder: Path) -> Sequence[Figure]:
    """Two panels for the rules, one for the blocked shares."""
    falls: list[Fall] = outcome.data
    drawing = new_drawing(11.5, 3.5)
    *panels, last = plots(drawing, 1, 3)[0]
    for axes, rules in zip(panels, RULES, strict=True):
        for model in MODELS:
            mine = [fall for fall in falls if (fall.rules, fall.model) == (rules, model)]
            axes.step(
                [100.0 * e for e in EDGES_M],
                failed_share(mine),
                where="post",
                color=COLOURS[model],
                label=words.MODEL[model],
                linewidth=1.8,
            )
        axes.set(xlabel="edge of the cube, cm", ylabel="share of scenes failed", ylim=(0.0, 1.0), title=f"{words.RULES_WORD[rules]} rules")
    panels[0].legend()
    for model in MODELS:
        at = np.sort([100.0 * fall.blocked for fall in falls if fall.failed and (fall.rules, fall.model) == ("paper", model)])
        if len(at):
            last.step(at, np.arange(1, len(at) + 1) / len(at), where="post", color=COLOURS[model], linewidth=1.8)
    last.set(xlabel="neurons blocked at the first failure, %", ylabel="share of failures", ylim=(0.0, 1.0), xlim=(0.0, 100.0))
    return [save(drawing, folder, "big-obstacles", CAPTION)]
