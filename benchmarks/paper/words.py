"""How the report calls things."""

from __future__ import annotations

from benchmarks.paper.ask import Variant

__all__ = ["ALGORITHM", "MODEL", "RULES_WORD", "yes_no"]

MODEL = {"som": "SOM", "gamma_som": "γ-SOM", "gng": "GNG"}
ALGORITHM = {"wavefront": "wavefront", "dijkstra": "Dijkstra", "astar": "A*", "bidirectional": "bidirectional"}
RULES_WORD = {"paper": "paper's", "checked": "our"}
PEER = {"ompl_prm": "PRM", "ompl_rrt": "RRT", "ompl_rrt_connect": "RRTConnect"}


def yes_no(value: bool) -> str:
    """For a table's cell."""
    return "yes" if value else "no"


def row_head(variant: Variant) -> list[str]:
    """Rules, model, algorithm, smoothed."""
    return [RULES_WORD[variant.rules], MODEL[variant.model], ALGORITHM[variant.search], yes_no(variant.smooth)]
