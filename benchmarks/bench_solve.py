"""Problems of a file (MotionBenchMaker's format): how many a map, repair and fallback solve of those that RRTConnect can solve.

Each scene becomes cells that its shapes touch; the answer is judged by coal on the shapes themselves, every 1/256 rad. Solvable means that
RRTConnect solves it in 5 s of processor time: OMPL's on the true shapes (coal, bare meshes, no margin), ours in the very cells and
inflation that we plan in. What we solved ourselves counts as solvable there; by the true shapes if coal found no touch.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from dataclasses import asdict
from itertools import groupby
from pathlib import Path
from typing import Any

from rich.progress import track

from benchmarks.answers import fallback_of
from benchmarks.provenance import provenance
from benchmarks.solve_figures import figures, table
from benchmarks.solving import Record, Solver
from clients.cli.options import add_cell_arguments
from common.cell import load
from common.config import plain
from common.errors import RequestError
from services.planner.assemble import Parts, parts_of
from services.planner.config import PlannerConfig
from services.planner.offline.build import Built, Job, load_file, load_or_build
from services.planner.offline.problem_job import problem_job
from services.planner.offline.problem_motions import TrainingProblem

__all__ = ["add_arguments", "run"]

SOLVE_S = 5.0  # issue


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which problems, with which map, and where the figures go."""
    parser.add_argument("--problems", type=Path, required=True, metavar="FILE", help="JSON in MotionBenchMaker's format")
    which = parser.add_mutually_exclusive_group()
    which.add_argument(
        "--map", type=Path, default=None, metavar="FILE", help="of tolman build --problems; default: the one made from FILE itself"
    )
    which.add_argument(
        "--folds", type=int, default=None, metavar="N", help="train on all but every N-th problem of a set, ask those; N times"
    )
    parser.add_argument("--fold", type=int, default=None, metavar="K", help="of --folds: only the K-th, from 0")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="ask only every N-th of the problems (default all)")
    parser.add_argument("--limit", type=float, default=SOLVE_S, metavar="S", help="RRTConnect's time to show that a problem can be solved")
    parser.add_argument("--json", type=Path, default=None, metavar="FILE")
    add_cell_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Ask, judge, print, write."""
    whole = problem_job(*load(args.config, "planner", PlannerConfig, args.set), args.problems)
    records: list[Record] = []
    maps: list[dict[str, Any]] = []
    for job, built, asked in _folds(args, whole):
        chosen = asked[:: args.every]
        records += _ask(parts_of(job, built), chosen, args.limit)
        seen = set(built.figures.get("problems", ()))
        n_seen = sum(p.digest in seen for p in chosen)
        maps.append({"sha256": built.sha256, "neurons": built.learned.n_neurons, "asked": len(chosen), "asked_and_trained_on": n_seen})
    by_set = sorted(records, key=lambda r: r.set_name)
    sets = {name: figures(list(group)) for name, group in groupby(by_set, key=lambda r: r.set_name)}
    sets["all"] = figures(records)
    print(table(sets))
    if args.json is not None:
        header = provenance(whole.config.problems.seed, plain(whole.config))
        report = {**header, "limit_s": args.limit, "maps": maps, "sets": sets, "problems": [asdict(r) for r in records]}
        args.json.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    return 0


def _ask(parts: Parts, problems: list[TrainingProblem], limit_s: float) -> list[Record]:
    with fallback_of(parts) as sample:
        solver = Solver(parts, sample, limit_s)
        for _, group in groupby(problems, key=lambda p: p.problem.set_name):
            solver.rehearse(next(group).problem)
        return [solver.ask(p.problem) for p in track(problems, "problems", transient=True, disable=not sys.stderr.isatty())]


def _folds(args: argparse.Namespace, job: Job) -> Iterator[tuple[Job, Built, list[TrainingProblem]]]:
    """For each map: its job, itself, and what it is asked."""
    if args.folds is None:
        if args.fold is not None:
            raise RequestError("--fold says which of --folds; without --folds there is none")
        yield job, _made(job) if args.map is None else load_file(job, args.map, job.scene_fingerprints), list(job.problems)
        return
    if args.folds < 2 or (args.fold is not None and not 0 <= args.fold < args.folds):
        raise RequestError(f"--folds {args.folds} --fold {args.fold}: at least 2 folds, and one of 0 to folds - 1")
    for k in range(args.folds) if args.fold is None else [args.fold]:
        asked = {id(p) for _, group in groupby(job.problems, key=lambda p: p.problem.set_name) for p in list(group)[k :: args.folds]}
        trained = job.on([p for p in job.problems if id(p) not in asked])
        yield trained, _made(trained), [p for p in job.problems if id(p) in asked]


def _made(job: Job) -> Built:
    return load_or_build(job, lambda stage, share: print(f"{stage}: done", file=sys.stderr, flush=True) if share == 1.0 else None)
