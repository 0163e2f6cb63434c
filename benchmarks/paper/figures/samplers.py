"""Several runs of each sampling planner on the question of the tables, with ours drawn in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.paper import words
from benchmarks.paper.ask import Variant, answer
from benchmarks.paper.figures.bitmaps import tool_way
from benchmarks.paper.outcome import Outcome, Table
from benchmarks.paper.shared_runs import the_question
from benchmarks.paper.stats import mean_sigma
from benchmarks.paper.study import Study
from benchmarks.paper.table2 import PLANNERS, PeerRun, peer_runs
from benchmarks.peers.peer import path_length_rad

__all__ = ["Ways", "measure"]

F64 = NDArray[np.float64]
INTRO = (
    "Each sampling planner is asked the question of the tables {n} times with different seeds; its tool paths are drawn thin, ours (GNG, "
    "Dijkstra, smoothed, checked rules; the same each time) bold and blue. Above: as found; below: simplified by OMPL."
)


@dataclass(frozen=True, eq=False)
class Ways:
    """Ways of the tool (K, 3) in metres by way of planning, our own, and the boxes (n, 2, 3)."""

    samplers_m: dict[str, list[F64]]
    ours_m: F64
    boxes_m: F64


def measure(study: Study) -> Outcome:
    """The paths of all runs."""
    question, robot = the_question(study), study.gng.robot
    runs = peer_runs(study, [question] * study.scale.n_sampler_paths)
    ours = answer(study.gng, study.gng.motion_planner(), question, Variant("gng", "dijkstra", True, "checked"))
    names = [f"{planner}-{how}" for how in ("raw", "simplified") for planner in PLANNERS]
    ways = {n: [tool_way(robot, run.path_rad) for run in runs if run.planner == n and run.path_rad is not None] for n in names}
    rows = [{"row": run.planner, "seed": run.seed, "ms": run.ms, "length_rad": _length(run)} for run in runs]
    table = Table("Lengths of what is drawn", ("planner", "runs with a path", "length, rad"), [_row(runs, name) for name in names])
    data = Ways(ways, tool_way(robot, ours.path_rad), question.boxes_m)
    return Outcome(INTRO.format(n=study.scale.n_sampler_paths), rows=rows, tables=[table], data=data)


def _length(run: PeerRun) -> float | None:
    return None if run.path_rad is None else path_length_rad(run.path_rad)


def _row(runs: list[PeerRun], name: str) -> list[str]:
    lengths = [path_length_rad(run.path_rad) for run in runs if run.planner == name and run.path_rad is not None]
    planner, _, how = name.partition("-")
    return [f"{words.PEER[planner]}, {how}", str(len(lengths)), mean_sigma(lengths)]
