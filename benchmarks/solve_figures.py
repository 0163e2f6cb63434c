"""From records of problems to the figures of ``tolman bench solve``."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.solving import WAYS, Record

__all__ = ["figures", "table"]


def figures(records: Sequence[Record]) -> dict[str, Any]:
    """The figures of some records.

    ``solved_share``: of ``n_solvable_cells``, by the map, by map or repair, by any way. ``exact_share``: of ``n_solvable_exact``, by any
    way and free by coal. ``length_ratio``: median of ours over RRTConnect's simplified one. ``time_ms``: of the answers of each way.
    ``lost_to_cells``: why exactly solvable problems are not solvable in cells; ``map_says``: what became of those solvable in cells.
    """
    cells = [r for r in records if r.is_solvable_cells]
    exact = [r for r in records if r.is_solvable_exact]
    ratios = [r.length_rad / r.reference_rad for r in records if r.length_rad and r.reference_rad]
    return {
        "n_total": len(records),
        "n_solvable_exact": len(exact),
        "n_solvable_cells": len(cells),
        "solved_share": {
            "map": _share([r for r in cells if r.way == "map"], cells),
            "repair": _share([r for r in cells if r.way in ("map", "repair")], cells),
            "all": _share([r for r in cells if r.way is not None], cells),
        },
        "exact_share": _share([r for r in exact if r.way is not None and not r.collides], exact),
        "collisions": sum(r.collides for r in records),
        "length_ratio": round(float(np.median(ratios)), 3) if ratios else None,
        "time_ms": {way: _percentiles([r.ms for r in records if r.way == way]) for way in WAYS},
        "exact": dict(Counter(r.exact for r in records)),
        "lost_to_cells": dict(Counter(r.cells for r in exact if not r.is_solvable_cells)),
        "map_says": dict(Counter(r.map_says for r in cells)),
    }


def table(sets: dict[str, dict[str, Any]]) -> str:
    """The main figures as lines of text, one a set."""
    shares = f"{'map':>7}{'repair':>7}{'all':>7}{'exact_share':>12}"
    lines = [f"{'set':<18}{'total':>6}{'exact':>6}{'cells':>6}{shares}{'hits':>5}{'length':>7}  the map says"]
    for name, f in sets.items():
        shares = "".join(_cell(f["solved_share"][way], 7) for way in ("map", "repair", "all"))
        counts = f"{f['n_total']:>6}{f['n_solvable_exact']:>6}{f['n_solvable_cells']:>6}"
        says = ", ".join(f"{why} {n}" for why, n in sorted(f["map_says"].items()))
        lines.append(f"{name:<18}{counts}{shares}{_cell(f['exact_share'], 12)}{f['collisions']:>5}{_cell(f['length_ratio'], 7)}  {says}")
    return "\n".join(lines)


def _cell(value: float | None, width: int) -> str:
    return f"{'-':>{width}}" if value is None else f"{value:>{width}.2f}"


def _share(some: Sequence[Record], of: Sequence[Record]) -> float | None:
    return round(len(some) / len(of), 4) if of else None


def _percentiles(values: list[float]) -> dict[str, float | int]:
    if not values:
        return {"n": 0}
    p50, p95 = np.percentile(values, [50, 95])
    return {"n": len(values), "p50": round(float(p50), 2), "p95": round(float(p95), 2), "max": round(max(values), 2)}
