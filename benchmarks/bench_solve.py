"""Problems of a file (MotionBenchMaker's format): how many a map, repair and fallback solve of those that RRTConnect can solve.

Each scene becomes cells that its shapes touch; the answer is judged by coal on the shapes themselves, every 1/256 rad. Solvable means that
RRTConnect solves it in 5 s of processor time: OMPL's on the true shapes (coal, bare meshes, no margin), ours in the very cells and
inflation that we plan in. What we solved ourselves counts as solvable there; by the true shapes if coal found no touch.
"""

from __future__ import annotations

import argparse
import hashlib
import sys
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

from rich.progress import track

from benchmarks.answers import fallback_of
from benchmarks.provenance import provenance
from benchmarks.solve_figures import table
from benchmarks.solve_report import Fold, SolveReport
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
    parser.add_argument("--json", type=Path, default=None, metavar="FILE", help="written anew after each fold")
    parser.add_argument("--go-on", action="store_true", help="with the folds that are in the --json FILE of an equal run, if there is one")
    add_cell_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Ask, judge, print, write."""
    if args.go_on and (args.json is None or args.folds is None):
        raise RequestError("--go-on needs the --json FILE that it goes on with, and --folds")
    whole = problem_job(*load(args.config, "planner", PlannerConfig, args.set), args.problems)
    header = provenance(whole.config.problems.seed, plain(whole.config))
    asked_of = hashlib.sha256(args.problems.read_bytes()).hexdigest()
    report = SolveReport({**header, "problems_sha256": asked_of, "limit_s": args.limit, "folds": args.folds, "every": args.every})
    if args.go_on and args.json.exists():
        report.go_on(args.json)
    for number, job, built, problems in _folds(args, whole, report):
        asked = problems[:: args.every]
        records = _ask(parts_of(job, built), asked, args.limit)
        seen = set(built.figures.get("problems", ()))
        n_seen = sum(p.digest in seen for p in asked)
        facts = {"sha256": built.sha256, "neurons": built.learned.n_neurons, "asked": len(asked), "asked_and_trained_on": n_seen}
        report.folds.append(Fold({"fold": number, **facts}, records))
        if args.json is not None:
            report.write(args.json)
    print(table(report.sets))
    return 0


def _ask(parts: Parts, problems: list[TrainingProblem], limit_s: float) -> list[Record]:
    with fallback_of(parts) as sample:
        solver = Solver(parts, sample, limit_s)
        for _, group in groupby(problems, key=lambda p: p.problem.set_name):
            solver.rehearse(next(group).problem)
        return [solver.ask(p.problem) for p in track(problems, "problems", transient=True, disable=not sys.stderr.isatty())]


def _folds(args: argparse.Namespace, job: Job, report: SolveReport) -> Iterator[tuple[int | None, Job, Built, list[TrainingProblem]]]:
    """For each map that is to be asked: the fold's number, its job, itself, and what it is asked."""
    if args.folds is None:
        if args.fold is not None:
            raise RequestError("--fold says which of --folds; without --folds there is none")
        yield None, job, _made(job) if args.map is None else load_file(job, args.map, job.scene_fingerprints), list(job.problems)
        return
    if args.folds < 2 or (args.fold is not None and not 0 <= args.fold < args.folds):
        raise RequestError(f"--folds {args.folds} --fold {args.fold}: at least 2 folds, and one of 0 to folds - 1")
    for k in range(args.folds) if args.fold is None else [args.fold]:
        if report.kept(k):
            continue
        asked = {id(p) for _, group in groupby(job.problems, key=lambda p: p.problem.set_name) for p in list(group)[k :: args.folds]}
        trained = job.on([p for p in job.problems if id(p) not in asked])
        yield k, trained, _made(trained), [p for p in job.problems if id(p) in asked]


def _made(job: Job) -> Built:
    return load_or_build(job, lambda stage, share: print(f"{stage}: done", file=sys.stderr, flush=True) if share == 1.0 else None)
