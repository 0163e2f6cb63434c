"""Every figure of the paper that is at hand, with the place where we read it. What is not here is written "not at hand".

The paper: L. Steffen, T. Weyer, S. Ulbrich, A. Roennau, R. Dillmann, "Reactive Neural Path Planning with Dynamic Obstacle Avoidance in a
Condensed Configuration Space", arXiv 2207.03959 (2022).
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["KNOWN", "PAPER", "Known", "known"]

PAPER = (
    "L. Steffen, T. Weyer, S. Ulbrich, A. Roennau, R. Dillmann: Reactive Neural Path Planning with Dynamic Obstacle Avoidance in a "
    "Condensed Configuration Space. arXiv:2207.03959, 2022"
)
NOTES = "the project's notes on the paper"
ABSTRACT = "abstract of arXiv:2207.03959"


@dataclass(frozen=True)
class Known:
    """A figure of the paper: what, how much, read where."""

    what: str
    value: str
    source: str


KNOWN: dict[str, Known] = {
    "replan_s": Known("re-planning of a motion", "0.02 s", ABSTRACT),
    "search_ms": Known("search for a path", "13 ms", NOTES),
    "smoothed_ms": Known("search and smoothing", "37 ms", NOTES),
    "n_neurons": Known("neurons of the map", "10 000 (100 x 100)", NOTES),
    "n_trajectories": Known("training motions", "1 230", NOTES),
    "n_samples": Known("training samples", "50 728", NOTES),
    "cell_m": Known("edge of a cell", "2 cm", NOTES),
    "tick_s": Known("a new plan at least every", "0.3 s", NOTES),
    "n_runs": Known("runs behind a row of its tables", "20", NOTES),
    "robot": Known("arm", "Universal Robots UR3e", NOTES),
}


def known(key: str) -> str:
    """The value of a known figure, for a table's cell."""
    return KNOWN[key].value
