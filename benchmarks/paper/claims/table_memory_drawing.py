"""Draws bytes and query times over the size of the map."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.paper.canvas import COLOURS, new_drawing, plots, save
from benchmarks.paper.claims.table_memory import MB, Memory
from benchmarks.paper.outcome import Figure, Outcome

__all__ = ["draw"]


def draw(outcome: Outcome, folder: Path) -> Sequence[Figure]:
    """Bytes left, query times right."""
    sizes: list[Memory] = outcome.data
    drawing = new_drawing(9.5, 3.4)
    left, right = plots(drawing, 1, 2)[0]
    n = [s.n_neurons / 1000.0 for s in sizes]
    left.plot(n, [s.ours_bytes / MB for s in sizes], "o-", color=COLOURS["gng"], label="ours, neurons and edges")
    left.plot(n, [s.ours_node_bytes / MB for s in sizes], "o--", color=COLOURS["gng"], label="ours, neurons only")
    left.plot(n, [s.bit_bytes / MB for s in sizes], "s-", color=COLOURS["gamma_som"], label="bits, neurons only")
    left.set(xlabel="neurons, thousands", ylabel="table, MB", ylim=(0.0, None))
    left.legend()
    for table, colour in (("ours", COLOURS["gng"]), ("bits", COLOURS["gamma_som"])):
        for query, style in (("appear", "-"), ("move", "--")):
            right.plot(n, [np.median(s.us[f"{table} {query}"]) for s in sizes], f"o{style}", color=colour, label=f"{table}, {query}")
    right.set(xlabel="neurons, thousands", ylabel="query, µs", ylim=(0.0, None))
    right.legend()
    return [save(drawing, folder, "table-memory", "Memory of the table and time of a query, ours beside a bit-encoded table.")]
