"""Draws what each map solves."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.paper import words
from benchmarks.paper.ask import RULES
from benchmarks.paper.canvas import COLOURS, new_drawing, plain_log, plots, save
from benchmarks.paper.claims.solved_share import Solved
from benchmarks.paper.outcome import Figure, Outcome
from benchmarks.paper.study import MODELS

__all__ = ["draw"]

CAPTION = (
    "Left: questions solved by each map, in per cent of all; the grey line is what is solvable. Right: time of the answers, solved or not."
)


def draw(outcome: Outcome, folder: Path) -> Sequence[Figure]:
    """Shares left, distribution of times (our rules) right."""
    found: list[Solved]
    found, solvable = outcome.data
    drawing = new_drawing(10.0, 3.2)
    left, right = plots(drawing, 1, 2)[0]
    n = len(solvable)
    for k, model in enumerate(MODELS):
        mine = [s for s in found if s.model == model]
        shares = [100.0 * sum(s.solved) / n for s in mine]
        left.bar(np.arange(len(mine)) + 0.26 * (k - 1), shares, width=0.24, color=COLOURS[model], label=words.MODEL[model])
        ms = np.sort(next(s.ms for s in mine if s.rules == "checked"))
        right.step(ms, np.arange(1, n + 1) / n, where="post", color=COLOURS[model], linewidth=1.8)
    left.axhline(100.0 * sum(solvable) / n, color=COLOURS["paper"], linewidth=1.0)
    left.set_xticks(range(len(RULES)), [f"{words.RULES_WORD[rules]} rules" for rules in RULES])
    left.set(ylabel="solved, %", ylim=(0.0, 102.0))
    left.grid(visible=False, axis="x")
    left.legend(ncols=3, loc="lower left", bbox_to_anchor=(0.0, 1.0), fontsize=9)
    right.set(xscale="log", xlabel="answer, ms (our rules)", ylabel="share of questions", ylim=(0.0, 1.02))
    plain_log(right.xaxis, [0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0])
    return [save(drawing, folder, "solved-share", CAPTION)]
