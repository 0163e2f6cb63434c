"""How build, bytes and answers grow with the map: 1 000 to 100 000 neurons, cells of 1 to 4 cm.

Each map is built from nothing, motions included, with all kernels compiled beforehand, and kept; a map that this command built before is
not built again (``--force`` builds it), its times are those of then. The questions are those of the set ``task``, put to the map alone; in
cells of another size the boxes of a question take as much space.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

from benchmarks.provenance import provenance
from benchmarks.sizes import Size, at_size, built_at_size, compile_kernels, questions_at_size
from common.cell import load
from common.config import plain
from common.errors import RequestError, TolmanError
from services.planner.config import PlannerConfig

__all__ = ["add_arguments", "run"]

NEURONS, CELLS_M = (1_000, 10_000, 30_000, 100_000), (0.01, 0.04)  # issue
USUAL = Size(10_000, 0.02)
MB, GB = 1e6, 1e9


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which sizes, how many questions, and where the figures go."""
    parser.add_argument("--neurons", type=int, nargs="+", default=None, metavar="N", help="only maps of so many neurons")
    parser.add_argument("--cells", type=float, nargs="+", default=None, metavar="M", help="only cells of these edges in metres")
    parser.add_argument("--n", type=int, default=500, help="questions a map (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the questions")
    parser.add_argument("--force", action="store_true", help="build maps anew that this command built before")
    parser.add_argument("--json", type=Path, default=None, metavar="FILE")
    parser.add_argument("--plot", type=Path, default=None, metavar="PNG", help="draw it too")
    parser.add_argument("--config", type=Path, default=None, metavar="FILE", help="cell config; default: the UR3 cell")
    parser.add_argument("--override", action="append", default=[], metavar="KEY=VALUE", help="as --set elsewhere: planner.search=astar")


def sizes_of(args: argparse.Namespace) -> list[Size]:
    """All sizes of the issue, or all combinations of what is named; what is not named is as usual."""
    if args.neurons is None and args.cells is None:
        return [Size(n, USUAL.cell_m) for n in NEURONS] + [Size(USUAL.neurons, cell_m) for cell_m in CELLS_M]
    return [Size(n, cell_m) for cell_m in args.cells or [USUAL.cell_m] for n in args.neurons or [USUAL.neurons]]


def run(args: argparse.Namespace) -> int:
    """Build, ask, print, write, draw; the files are written again after each size."""
    cell, config = load(args.config, "planner", PlannerConfig, args.override)
    if args.n < 1:
        raise RequestError(f"--n {args.n}: at least one question is needed", code="out_of_range")
    sizes = [(size, *at_size(cell, config, size)) for size in sizes_of(args)]  # what cannot be built is told before anything is
    _apart(compile_kernels, cell, config)
    rows: list[dict[str, Any]] = []
    solvable: dict[float, dict[int, bool]] = {}  # by edge of the cells: the questions are the same whatever the map
    print(HEADER)
    for size, *of_size in sizes:
        at = *of_size, str(size)
        figures = _apart(built_at_size, *at, force=args.force)
        asked, solvable[size.cell_m] = _apart(questions_at_size, *at, args.n, args.seed, solvable.get(size.cell_m, {}))
        rows.append({"cell_m": size.cell_m, **figures, **asked})
        print(_line(rows[-1]), flush=True)
        if args.json is not None:
            report = {**provenance(args.seed, plain(config)), "set": "task", "n": args.n, "sizes": rows}
            args.json.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
        if args.plot is not None:
            from benchmarks.sizes_drawing import draw  # noqa: PLC0415  matplotlib is an extra

            draw(rows, args.plot)
    return 0


def _apart(work: Callable[..., Any], *args: Any, **options: Any) -> Any:
    """The result of ``work`` in a process of its own, so that its memory is its own.

    Raises:
        TolmanError: ``worker_lost``: the process was ended from outside.
    """
    try:
        with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as executor:
            return executor.submit(work, *args, **options).result()
    except BrokenProcessPool:
        raise TolmanError(
            "the process that builds or asks a map was ended; ask again, what was built is kept", code="worker_lost"
        ) from None


HEADER = (
    f"{'neurons':>8}{'cells cm':>9}{'edges':>8}{'build s':>9}{'cells MB':>9}{'layers MB':>10}{'file MB':>9}{'build GB':>9}"
    f"{'planner GB':>11}{'connect+search ms p50 p95 p99':>32}{'answer ms p50 p95 p99':>26}{'solved':>8}"
)


def _line(row: dict[str, Any]) -> str:
    def three(name: str, width: int) -> str:
        values = row.get(f"{name}_ms")
        return f"{' '.join(f'{values[p]:.2f}' for p in ('p50', 'p95', 'p99')) if values else '-':>{width}}"

    return (
        f"{row['neurons']:>8}{100.0 * row['cell_m']:>9g}{row['edges']:>8}{row['build_s']['total']:>9.1f}{row['table_bytes'] / MB:>9.0f}"
        f"{row['layer_bytes'] / MB:>10.0f}{row['artefact_bytes'] / MB:>9.0f}{row['build_peak_bytes'] / GB:>9.2f}"
        f"{row['planner_bytes'] / GB:>11.2f}{three('connect_search', 32)}{three('answer', 26)}{row['solved_share']:>8.3f}"
    )
