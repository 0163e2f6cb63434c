"""Draws GNG's lengths against the gamma-SOM's."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from benchmarks.paper.claims.pairs_drawing import draw_pairs
from benchmarks.paper.outcome import Figure, Outcome

__all__ = ["draw"]


def draw(outcome: Outcome, folder: Path) -> Sequence[Figure]:
    """A panel for each pair."""
    caption = "Joint length on the same scenes: GNG upright, γ-SOM along. Below the line GNG is shorter."
    return draw_pairs(outcome.data, folder, "gng-shorter", ("GNG, rad", "γ-SOM, rad"), caption)
