"""The memory of the lookup table against the size of the map, and a bit-encoded table beside ours: bytes and query times."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from benchmarks.paper.claims.bit_table import BitTable
from benchmarks.paper.outcome import HOLDS, IN_PART, NOT, NOT_AT_HAND, UNDECIDED, Holds, Outcome, Table, Verdict
from benchmarks.paper.stats import median
from benchmarks.paper.study import Study
from benchmarks.questions import Question
from services.planner.assemble import Parts
from services.planner.offline.regions import box_cells

__all__ = ["Memory", "measure"]

I32 = NDArray[np.int32]
REPEATS = 5  # of each query; the fastest counts: the others were interrupted
MB = 1e6
LINEAR_WITHIN = 0.1  # our choice: farthest that a size may lie from the line, as a share of it
INTRO = (
    "Ours: for each cell a list of the neurons it blocks (uint16), and of the edges it blocks beyond their ends; a count a neuron says "
    "how many occupied cells block it, so that cells may come and go one by one. Bit-encoded (Wu 2005, named in the paper's outlook; its "
    "text was not at hand, so this is the plain form of the idea): for each cell that blocks anything one bit a neuron; blocked is the "
    "bitwise or of the rows of all occupied cells, read anew whenever a cell goes. Both by compiled code (numba; numpy's reduce). "
    "*Appear*: the boxes of {n} questions come into an empty world. *Move*: they go on by one cell (2 cm). Both tables give the same "
    "blocked neurons in every query, or this part fails."
)


@dataclass
class Memory:
    """One size: bytes, and microseconds of each query."""

    n_neurons: int
    ours_bytes: int
    ours_node_bytes: int
    bit_bytes: int
    us: dict[str, list[float]] = field(default_factory=dict)

    def add(self, what: str, ns: float) -> None:
        """Keep the time of a query."""
        self.us.setdefault(what, []).append(ns / 1e3)


def measure(study: Study) -> Outcome:
    """Every size."""
    sizes = [_size(study, n) for n in study.scale.network_sizes]
    rows = [
        [
            f"{s.n_neurons:,}".replace(",", " "),
            f"{s.ours_bytes / MB:.1f}",
            f"{s.ours_node_bytes / MB:.1f}",
            f"{s.bit_bytes / MB:.1f}",
            *(median(s.us[f"{table} {query}"], 0) for query in ("appear", "move") for table in ("ours", "bits")),
        ]
        for s in sizes
    ]
    columns = (
        "neurons",
        "ours, MB",
        "ours, neurons only, MB",
        "bits (neurons only), MB",
        "appear: ours, µs",
        "appear: bits, µs",
        "move: ours, µs",
        "move: bits, µs",
    )
    raw = [
        {
            "row": f"gng-{s.n_neurons}",
            "n_neurons": s.n_neurons,
            "ours_bytes": s.ours_bytes,
            "ours_node_bytes": s.ours_node_bytes,
            "bit_bytes": s.bit_bytes,
            **{f"{key.replace(' ', '_')}_us_median": float(np.median(values)) for key, values in s.us.items()},
        }
        for s in sizes
    ]
    note = f"Times: medians over {study.scale.n_scenes} questions, the fastest of {REPEATS} tries each. 1 MB is 10^6 bytes."
    verdicts = [_linear(sizes), _smaller(sizes)]
    tables = [Table("Bytes and query times", columns, rows, note)]
    return Outcome(INTRO.format(n=study.scale.n_scenes), rows=raw, tables=tables, verdicts=verdicts, data=sizes)


def _size(study: Study, n_neurons: int) -> Memory:
    parts = study.sized(n_neurons)
    table, n = parts.roadmap.table, parts.roadmap.n_neurons
    bits = BitTable.of(table, n)
    memory = Memory(n, table.n_bytes, table.node_offset.nbytes + table.node_owner.nbytes, bits.n_bytes)
    scenes = study.scenes(study.scale.n_scenes)
    for question in study.shown(scenes, f"{n_neurons} neurons", len(scenes)):
        _query(parts, bits, question, memory)
    return memory


def _query(parts: Parts, bits: BitTable, question: Question, memory: Memory) -> None:
    nothing = np.empty(0, dtype=np.int32)
    there, moved = _cells(parts, question.boxes_m), _cells(parts, question.boxes_m + np.array([parts.grid.resolution_m, 0.0, 0.0]))
    counts = parts.roadmap.counts(parts.grid)
    for what, before, after in (("appear", nothing, there), ("move", there, moved)):
        memory.add(f"ours {what}", _fastest(partial(counts.set_cells, before), partial(counts.set_cells, after)))
        memory.add(f"bits {what}", _fastest(list, partial(bits.blocked_words, after)))
        if not np.array_equal(bits.blocked(after), counts.node > 0):
            raise AssertionError(f"question {question.index}: the bit-encoded table blocks other neurons than ours")


def _cells(parts: Parts, boxes_m: NDArray[np.float64]) -> I32:
    cells = np.unique(np.concatenate([box_cells(parts.grid, low, high) for low, high in boxes_m]))
    return np.setdiff1d(cells, parts.roadmap.table.unavoidable).astype(np.int32)


def _fastest(prepare: Callable[[], object], query: Callable[[], object]) -> float:
    """Nanoseconds of the fastest of some tries; each is prepared first."""
    best = np.inf
    for _ in range(REPEATS):
        prepare()
        began = time.perf_counter_ns()
        query()
        best = min(best, time.perf_counter_ns() - began)
    return float(best)


def _linear(sizes: list[Memory]) -> Verdict:
    """A straight line through bytes over neurons: the constant is the offsets of all cells."""
    n, size = np.array([s.n_neurons for s in sizes], dtype=np.float64), np.array([s.ours_bytes for s in sizes], dtype=np.float64)
    slope, constant = np.polyfit(n, size, 1)
    farthest = float(np.max(np.abs(constant + slope * n - size) / size))
    said = f"{slope / 1e3:.2f} kB a neuron and {constant / MB:.1f} MB for all cells; sizes lie within {100 * farthest:.0f} % of that line"
    holds: Holds = UNDECIDED if len(sizes) < 3 else HOLDS if farthest < LINEAR_WITHIN else NOT
    return Verdict("The memory of the table grows linearly with the map", NOT_AT_HAND, said, holds)


def _smaller(sizes: list[Memory]) -> Verdict:
    largest = sizes[-1]
    ratio = largest.bit_bytes / largest.ours_node_bytes
    faster = np.median(largest.us["bits appear"]) < np.median(largest.us["ours appear"])
    smaller = ratio < 1.0
    holds = HOLDS if smaller and faster else IN_PART if smaller or faster else NOT
    said = (
        f"at {largest.n_neurons} neurons {largest.bit_bytes / MB:.0f} MB of bits against {largest.ours_node_bytes / MB:.0f} MB of lists "
        f"(neurons only); appear {median(largest.us['bits appear'], 0)} µs against {median(largest.us['ours appear'], 0)} µs, move "
        f"{median(largest.us['bits move'], 0)} µs against {median(largest.us['ours move'], 0)} µs"
    )
    word = (
        "A bit a neuron pays when a cell blocks more than one neuron in sixteen; a list of uint16 pays below that. Ours also keep edges "
        "and counts."
    )
    return Verdict("A bit-encoded table saves memory and time (the paper's outlook)", NOT_AT_HAND, said, holds, word)
