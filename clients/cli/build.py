"""``tolman build``: make the cognitive map and its table, unless they are there already."""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from benchmarks.provenance import provenance
from clients.cli.options import add_cell_arguments
from common import cell
from common.config import load_tables
from common.errors import ArtefactError
from services.planner.config import PlannerConfig
from services.planner.offline.build import STAGES, Built, Job, load
from services.planner.offline.build import Progress as OnProgress
from services.planner.offline.build import run as build
from services.planner.offline.growth import parameters_of
from services.planner.offline.problem_job import problem_job

__all__ = ["add_arguments", "run"]

# A map that plans a little: for a first look and for tests. No figure is measured with it. Our choice.
QUICK = [
    "planner.map.n_neurons=800",
    *(f"planner.{model}.{side}=28" for model in ("som", "gamma_som") for side in ("rows", "columns")),
    "planner.motions.n_trajectories=120",
    "planner.motions.n_samples=6000",
]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Whether to make it anew, and where its figures go."""
    parser.add_argument("--force", action="store_true", help="make motions, map and table anew, whatever is there")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures of the map there")
    parser.add_argument("--quick", action="store_true", help="a small map in some seconds, for a first look")
    parser.add_argument(
        "--motions", type=Path, nargs="+", default=[], metavar="FILE", help="motions to train on too: of tolman teach, .npy, .csv"
    )
    parser.add_argument(
        "--problems",
        type=Path,
        metavar="FILE",
        help="a map for the scenes of these problems (MotionBenchMaker's, as JSON) instead of the cell",
    )
    parser.add_argument("--out", type=Path, metavar="FILE", help="also write the map there")
    parser.add_argument(
        "--extend",
        type=Path,
        nargs="+",
        default=[],
        metavar="FILE",
        help="keep the map and let it grow on these motions too (by planner.extend.n_added neurons); a gas only, a SOM cannot",
    )
    parser.epilog = """A map made with --motions or --extend is another map: a stack takes it when its config names the same files,
    tolman up --set 'planner.taught=["FILE"]' or --set 'planner.extend.motions=["FILE"]'."""
    add_cell_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """0: the map is there."""
    overrides = [*(QUICK if args.quick else []), *args.set]
    shared, config = cell.load(args.config, "planner", PlannerConfig, overrides)
    make = partial(problem_job, path=args.problems) if args.problems is not None else Job.of
    job = make(shared, config, recorded=args.motions, extension=args.extend)
    seconds: dict[str, float] = {}
    built = None if args.force else _kept(job)
    if built is None:
        with _progress() as on_progress:
            built, seconds = build(job, on_progress, force=args.force)
    if args.out is not None:
        shutil.copyfile(built.path, args.out)
    report = {
        **provenance(parameters_of(job.config).seed, load_tables(args.config, overrides)),
        **built.figures,
        "seconds": seconds.get("total"),
        "seconds_of": seconds,
        "sha256": built.sha256,
    }
    if args.json is not None:
        args.json.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(_describe(built, seconds))
    return 0


def _kept(job: Job) -> Built | None:
    try:
        return load(job)
    except ArtefactError as error:
        if job.path.exists():
            print(f"{error.code}: {error.message}: it is made anew", file=sys.stderr)
        return None


@contextmanager
def _progress() -> Iterator[OnProgress]:
    """A bar for each stage on a terminal, else a line when a stage begins and ends."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield _stage_lines()
        return
    with Progress(TextColumn("{task.description:<8}"), BarColumn(), TimeElapsedColumn(), console=console) as bars:
        tasks = {stage: bars.add_task(stage, total=1.0, start=False) for stage in STAGES}

        def update(stage: str, share: float) -> None:
            if not bars.tasks[tasks[stage]].started:
                bars.start_task(tasks[stage])
            bars.update(tasks[stage], completed=share)

        yield update


def _stage_lines() -> OnProgress:
    told: set[tuple[str, float]] = set()

    def tell(stage: str, share: float) -> None:
        if share in (0.0, 1.0) and (stage, share) not in told:
            told.add((stage, share))
            print(f"{stage}: {'begins' if share == 0.0 else 'done'}", file=sys.stderr, flush=True)

    return tell


def _describe(built: Built, seconds: dict[str, float]) -> str:
    def word(value: Any) -> str:
        return f"{value:.4g}" if isinstance(value, float) else str(value)

    lines = [f"  {name:<24} {word(value)}" for name, value in built.figures.items() if not isinstance(value, list)]
    verb = "extended" if "extend" in seconds else "made"
    how = f"{verb} in {seconds['total']:.0f} s" if seconds else "was there already"
    return "\n".join([f"{built.path} {how}", *lines, f"  {'sha256':<24} {built.sha256}"])
