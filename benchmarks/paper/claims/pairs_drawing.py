"""Draws pairs: each scene a point, equal on the diagonal."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.paper.canvas import COLOURS, new_drawing, plots, save
from benchmarks.paper.claims.pairs import Pair
from benchmarks.paper.outcome import Figure

__all__ = ["draw_pairs"]

ROOM = 1.05  # of the axes beyond the largest value


def draw_pairs(pairs: Sequence[Pair], folder: Path, stem: str, labels: tuple[str, str], caption: str) -> Sequence[Figure]:
    """One panel a pair; ``labels`` of a (upright) and b (along)."""
    drawing = new_drawing(3.3 * len(pairs), 3.7)
    for axes, pair in zip(plots(drawing, 1, len(pairs))[0], pairs, strict=True):
        top = ROOM * max([*pair.a, *pair.b, 1e-9])
        axes.plot([0.0, top], [0.0, top], color=COLOURS["paper"], linewidth=1.0)
        axes.scatter(pair.b, pair.a, s=18, color=COLOURS["gng"], alpha=0.75, linewidths=0)
        less = int(np.sum(np.asarray(pair.a) < np.asarray(pair.b)))
        axes.set_title(f"{pair.name}\nbelow the line: {less} of {len(pair.a)}")
        axes.set(xlim=(0.0, top), ylim=(0.0, top), xlabel=labels[1], ylabel=labels[0], aspect="equal")
    return [save(drawing, folder, stem, caption)]
