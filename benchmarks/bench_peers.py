"""Ours beside planners of others on the same questions, each given the changed world afresh: time, tail, solved, length, collisions.

RRTConnect, RRT, PRM and BIT* of OMPL and RRTConnect of roboplan (extra ``[bench]``) with the same cells, hulls of the arm, margins and
joint step (:mod:`benchmarks.peers`). What is compared with what, and how failures count: :mod:`benchmarks.side_by_side`.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import track
from rich.table import Table

from benchmarks.answers import Answerer, fallback_of
from benchmarks.peers.peer import TIME_LIMIT_S, Peer, Setting, path_length_rad
from benchmarks.peers.registry import PEERS, make_peer
from benchmarks.provenance import provenance
from benchmarks.questions import SETS, Question, questions
from benchmarks.side_by_side import KINDS, OURS, Attempt, ask_ours, ask_peer, better_than_ours, figures_of, judged
from common.cell import load
from common.config import plain
from common.errors import RequestError
from services.planner.assemble import assemble
from services.planner.config import PlannerConfig
from services.planner.rehearsal import rehearse

__all__ = ["add_arguments", "run"]

WIDTH = 120  # columns of the tables where there is no terminal


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which questions, against whom, and where the figures go."""
    parser.add_argument("--set", dest="name", default="task", choices=SETS, help="questions (default %(default)s)")
    parser.add_argument("--n", type=int, default=500, help="how many (default %(default)s)")
    parser.add_argument("--peers", nargs="+", default=list(PEERS), metavar="NAME", help=f"of {', '.join(PEERS)}; default: all")
    parser.add_argument("--limit-s", type=float, default=TIME_LIMIT_S, help="a plan that takes longer is none (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of questions and peers (default %(default)s)")
    parser.add_argument("--json", type=Path, default=None, metavar="FILE")
    parser.add_argument("--config", type=Path, default=None, metavar="FILE", help="cell config; default: the UR3 cell")
    parser.add_argument("--override", action="append", default=[], metavar="KEY=VALUE", help="as --set elsewhere: planner.search=astar")


def run(args: argparse.Namespace) -> int:
    """Ask, judge, print, write."""
    if args.n < 1 or not args.limit_s > 0.0:
        raise RequestError(f"--n {args.n} --limit-s {args.limit_s:g}: at least one question and some time are needed", code="out_of_range")
    cell, config = load(args.config, "planner", PlannerConfig, args.override)
    setting = Setting.of(cell, config.margins)
    peers = [make_peer(name, setting) for name in dict.fromkeys(args.peers)]  # first of all: a library may be missing
    parts = assemble(cell, config)
    rehearse(parts, time.monotonic_ns)
    asked = list(_shown(questions(parts, args.name, args.n, args.seed), args.n, "questions"))
    with fallback_of(parts) as sampler:
        attempts = _attempts(Answerer(parts, sampler), peers, asked, args.limit_s, args.seed)
    attempts = judged(cell, attempts, asked, lambda verdicts, n: _shown(verdicts, n, "referee"))
    figures = figures_of(attempts, 1e3 * args.limit_s)
    better = better_than_ours(figures)
    _print(figures, better)
    if args.json is not None:
        report = {
            **provenance(args.seed, plain(config)),
            "set": args.name,
            "limit_s": args.limit_s,
            **figures,
            "peers_better": better,
            "attempts": [_plain(attempt) for attempt in attempts],
        }
        args.json.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    return 0


def _shown(items: Iterable[Any], n: int, what: str) -> Iterator[Any]:
    return iter(track(items, what, total=n, transient=True))


def _attempts(answerer: Answerer, peers: Sequence[Peer], asked: Sequence[Question], limit_s: float, seed: int) -> list[Attempt]:
    """All planners take turns at each question, so that what else the machine does hits all alike."""
    ask_ours(answerer, asked[0])  # what is made or cached on first use is not measured
    for peer in peers:
        peer.prepare()
        ask_peer(peer, asked[0], limit_s, seed)
    attempts: list[Attempt] = []
    for question in _shown(asked, len(asked), "planning"):
        attempts += ask_ours(answerer, question)
        for peer in peers:
            attempts += ask_peer(peer, question, limit_s, seed + question.index)
    return attempts


def _print(figures: dict[str, Any], better: Sequence[str]) -> None:
    console = Console()
    if not console.is_terminal:
        console = Console(width=WIDTH)
    for kind in KINDS:
        table = Table(
            title=f"{kind}: {figures['n_solvable']} questions that any planner solves, of {figures['n_questions']}", box=SIMPLE_HEAD
        )
        for column in ("planner", "solved", "p50, ms", "p95, ms", "p99, ms", "worst, ms", "x p50", "x p99", "rad", "to ours", "collide"):
            table.add_column(column, justify="left" if column == "planner" else "right", no_wrap=True)
        for name, kinds in figures["planners"].items():
            table.add_row(name, *_cells(name, kinds[kind]))
        console.print(table)
    console.print(
        "Failures count at the limit. x: their time as a multiple of ours. rad: median length; to ours: median of theirs / ours where both "
        "have a path. Raw: as found, joined to start and goal. Smoothed: ours timed and looked at again, theirs simplified. "
        "Refined: our second answer beside theirs simplified."
    )
    console.print("Where others are better than ours:" if better else "No peer is better than ours in anything measured here.")
    for line in better:
        console.print(f"  {line}", highlight=False)


def _cells(name: str, row: dict[str, Any]) -> list[str]:
    times, ratio, length = row["time_ms"], row.get("times_ours"), row["length_to_ours"]
    return [
        f"{row['n_solved']}",
        *(f"{times[key]:.1f}" if times else "–" for key in ("p50", "p95", "p99", "worst")),
        *(f"{ratio[key]:.1f}" if ratio else "" for key in ("p50", "p99")),
        "–" if row["length_rad_median"] is None else f"{row['length_rad_median']:.2f}",
        "" if name == OURS or length is None else f"{length['median']:.3f}",
        f"{row['collisions']}",
    ]


def _plain(attempt: Attempt) -> dict[str, Any]:
    """One attempt for the JSON: of its path only the length."""
    solved = attempt.path_rad is not None
    facts = {"planner": attempt.planner, "kind": attempt.kind, "question": attempt.question, "solved": solved}
    length_rad = None if attempt.path_rad is None else round(path_length_rad(attempt.path_rad), 4)
    return {**facts, "ms": round(attempt.ms, 3), "length_rad": length_rad, "collides": attempt.collides}
