"""Draws Dijkstra's lengths against the wavefront's."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from benchmarks.paper.claims.pairs_drawing import draw_pairs
from benchmarks.paper.outcome import Figure, Outcome

__all__ = ["draw"]


def draw(outcome: Outcome, folder: Path) -> Sequence[Figure]:
    """A panel for each map."""
    caption = (
        "Joint length on the same scenes, by the paper's rules: Dijkstra upright, wavefront along. Below the line Dijkstra is shorter."
    )
    return draw_pairs(outcome.data, folder, "dijkstra-shorter", ("Dijkstra, rad", "wavefront, rad"), caption)
