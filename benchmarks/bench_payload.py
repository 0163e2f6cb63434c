"""How long until the planner can plan with a box in its gripper: a box that is new, and one that is kept.

What is timed is what :class:`~services.planner.carrier.Carrier` does in its thread: the arm with the box, the box's rows and layers, the
joined table. Each repetition has a box a millimetre longer than the one before.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np

from benchmarks.provenance import provenance
from common.cell import load
from common.config import plain
from common.robot.payload import Payload
from services.planner.assemble import assemble
from services.planner.config import PlannerConfig
from services.planner.rehearsal import rehearse_holding

__all__ = ["add_arguments", "run"]

LONGER_M = 0.001


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which box, how often, and where the figures go."""
    parser.add_argument("--box", type=float, nargs=3, default=[0.05, 0.05, 0.08], metavar="M", help="full extents (default %(default)s)")
    parser.add_argument("--at", type=float, nargs=3, default=[0.0, 0.0, 0.04], metavar="M", help="its middle in the tool frame")
    parser.add_argument("--n", type=int, default=5, help="repetitions (default %(default)s)")
    parser.add_argument("--json", type=Path, default=None, metavar="FILE")
    parser.add_argument("--config", type=Path, default=None, metavar="FILE", help="cell config; default: the UR3 cell")
    parser.add_argument("--override", action="append", default=[], metavar="KEY=VALUE", help="as --set elsewhere")


def run(args: argparse.Namespace) -> int:
    """Hold, hold again, print, write."""
    cell, config = load(args.config, "planner", PlannerConfig, args.override)
    parts = assemble(cell, config)
    rehearse_holding(parts)
    new_s, kept_s = [], []
    for k in range(args.n):
        x, y, z = args.box
        began_s = time.perf_counter()
        made = parts.load(Payload.of([x, y, z + k * LONGER_M], args.at, None))
        held = parts.holding(made)
        new_s.append(time.perf_counter() - began_s)
        began_s = time.perf_counter()
        parts.holding(made.on(parts.roadmap))
        kept_s.append(time.perf_counter() - began_s)
    table = held.roadmap.table
    figures = {
        "n_neurons": held.roadmap.n_neurons,
        "n_edges": held.roadmap.n_edges,
        "new_s": {"p50": float(np.median(new_s)), "worst": max(new_s)},
        "kept_s": {"p50": float(np.median(kept_s)), "worst": max(kept_s)},
        "table_bytes": table.n_bytes,
        "layer_bytes": table.layers.n_bytes,
        "barred_neurons": len(table.barred_nodes),
        "barred_edges": len(table.barred_edges),
    }
    print(json.dumps(figures, indent=2))
    if args.json is not None:
        report = {**provenance(None, plain(config)), "box_m": args.box, "at_m": args.at, "n": args.n, **figures}
        args.json.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    return 0
