"""One map of a size: how long its build takes and what it weighs, and how long questions on it take. Each in a process of its own."""

from __future__ import annotations

import json
import os
import resource
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
from rich.console import Console
from rich.progress import track

from benchmarks.answers import Answerer, percentiles
from benchmarks.provenance import provenance
from benchmarks.questions import questions
from benchmarks.solvable import is_solvable
from common.cell import CellConfig, GridConfig
from common.errors import ArtefactError, RequestError
from services.planner.assemble import assemble
from services.planner.config import PlannerConfig
from services.planner.offline.build import Built, Job, load, run
from services.planner.rehearsal import rehearse

__all__ = ["Size", "at_size", "built_at_size", "compile_kernels", "questions_at_size"]

USUAL_NEURONS = 10_000  # of the config's motions and samples
SAMPLES_A_NEURON = 5  # as many as the config's 50 000 for 10 000
FEW_NEURONS, FEW_TRAJECTORIES, FEW_SAMPLES = 250, 8, 1500  # a map that is only built for its kernels to be compiled


@dataclass(frozen=True)
class Size:
    """Neurons of a map, and edge of its cells in metres."""

    neurons: int
    cell_m: float

    def __str__(self) -> str:
        return f"{self.neurons} neurons, {100.0 * self.cell_m:g} cm"


def at_size(cell: CellConfig, config: PlannerConfig, size: Size) -> tuple[CellConfig, PlannerConfig]:
    """Cell and config of a map of this size.

    A map of k times as many neurons as usual is made from sqrt(k) times as many motions, each sampled sqrt(k) times as finely: it knows
    more ways and follows each more closely (our choice). A smaller map is made from the usual motions.

    Raises:
        RequestError: cells of this size do not fill the grid, or no map has so many neurons.
    """
    try:
        of_map = msgspec.convert({**msgspec.to_builtins(config.map), "n_neurons": size.neurons}, type(config.map))
    except msgspec.ValidationError as error:
        raise RequestError(f"--neurons {size.neurons}: {error}", code="out_of_range") from None
    finer = max(1.0, size.neurons / USUAL_NEURONS)
    motions = msgspec.structs.replace(
        config.motions,
        n_trajectories=round(config.motions.n_trajectories * finer**0.5),
        n_samples=max(config.motions.n_samples, SAMPLES_A_NEURON * size.neurons),
    )
    changed = msgspec.structs.replace(config, motions=motions, map=of_map)
    return msgspec.structs.replace(cell, grid=_in_cells(cell.grid, size.cell_m)), changed


def _in_cells(grid: GridConfig, cell_m: float) -> GridConfig:
    if not cell_m > 0.0:
        raise RequestError(f"--cells {cell_m}: an edge is longer than 0 m", code="out_of_range")
    nx, ny, nz = (round(n * grid.resolution_m / cell_m) for n in grid.shape)
    if any(abs(n * cell_m - old * grid.resolution_m) > 1e-9 for n, old in zip((nx, ny, nz), grid.shape, strict=True)):
        raise RequestError(f"--cells {cell_m}: the grid of {grid.shape} cells of {grid.resolution_m} m is no whole number of these cells")
    return msgspec.structs.replace(grid, shape=(nx, ny, nz), resolution_m=cell_m)


def compile_kernels(cell: CellConfig, config: PlannerConfig) -> None:
    """Build a small map that nobody keeps, so that no size pays for compiling."""
    motions = msgspec.structs.replace(config.motions, n_trajectories=FEW_TRAJECTORIES, n_samples=FEW_SAMPLES, n_workers=1)
    few = msgspec.structs.replace(config, motions=motions, map=msgspec.structs.replace(config.map, n_neurons=FEW_NEURONS))
    with tempfile.TemporaryDirectory() as folder:
        run(Job.of(cell, few, cache=Path(folder)), _told("kernels"))


def built_at_size(cell: CellConfig, config: PlannerConfig, name: str, *, force: bool) -> dict[str, Any]:
    """Figures of the build of a map: seconds by stage, what it holds, bytes of all its parts, most memory in use.

    The map is kept, and beside it what its build took: both are used again unless ``force``. Call it in a fresh process.
    """
    job = Job.of(cell, config)
    beside = job.path.with_suffix(".build.json")
    kept = None if force else _kept(job, beside)
    if kept is not None:
        return kept
    built, seconds = run(job, _told(name), force=True)
    of_map = ("neurons", "edges", "components", "trajectories", "samples", "quantisation_error_rad", "table_bytes", "layer_bytes")
    figures = {
        **{key: built.figures[key] for key in of_map},
        "artefact_bytes": built.path.stat().st_size,
        "build_s": seconds,
        "build_peak_bytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,  # Linux counts in KiB
        "built": {key: value for key, value in provenance(None, None).items() if key in ("commit", "date")},
    }
    beside.write_text(json.dumps({"sha256": built.sha256, "figures": figures}), encoding="utf-8")
    return figures


def _kept(job: Job, beside: Path) -> dict[str, Any] | None:
    try:
        built: Built = load(job)
        record = json.loads(beside.read_text(encoding="utf-8"))
    except (ArtefactError, OSError, ValueError):
        return None
    return dict(record["figures"]) if record["sha256"] == built.sha256 else None


def questions_at_size(
    cell: CellConfig, config: PlannerConfig, name: str, n: int, seed: int, known: Mapping[int, bool]
) -> tuple[dict[str, Any], dict[int, bool]]:
    """Figures of the questions of the set ``task`` put to a kept map alone, and times of those it solved. Call it in a fresh process.

    ``known``: by index of a question, whether it can be solved, as far as maps with the same cells have shown; returned for all of them.
    """
    parts = assemble(cell, config)
    rehearse(parts, time.monotonic_ns)
    console = Console(stderr=True)
    asked = list(track(questions(parts, "task", n, seed), f"{name}: questions", total=n, console=console))
    answerer = Answerer(parts, None, ways=("map",))
    answers = [answerer.answer(question) for question in track(asked, f"{name}: answers", console=console)]
    resident_bytes = _resident_bytes()
    solved = [answer.ms for answer in answers if answer.way is not None]
    pairs = track(list(zip(asked, answers, strict=True)), f"{name}: solvable?", console=console)
    solvable = {q.index: answer.way is not None or (known[q.index] if q.index in known else is_solvable(parts, q)) for q, answer in pairs}
    n_solvable = sum(solvable.values())
    stages = ("update", "connect_search", "answer") if solved else ()
    figures = {
        "planner_bytes": resident_bytes,
        "n_questions": n,
        "n_solvable": n_solvable,
        "n_solved": len(solved),
        "solved_share": len(solved) / max(1, n_solvable),
        **{f"{stage}_ms": percentiles([ms[stage] for ms in solved]) for stage in stages},
    }
    return figures, solvable


def _resident_bytes() -> int:
    """Memory that this process has now (Linux)."""
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE")


def _told(name: str) -> Callable[[str, float], None]:
    """Progress of a build as lines on stderr: each stage at every tenth of it."""
    told: set[tuple[str, int]] = set()

    def tell(stage: str, share: float) -> None:
        tenth = int(10.0 * share)
        if (stage, tenth) not in told:
            told.add((stage, tenth))
            print(f"{name}: {stage} {10 * tenth} %", file=sys.stderr, flush=True)

    return tell
