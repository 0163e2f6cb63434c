"""The cognitive map as a bitmap, as in the paper: blocked neurons red, the path blue; and the way of the tool beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from benchmarks.paper import words
from benchmarks.paper.ask import Variant, answer
from benchmarks.paper.figures.layout import lattice_places, lay_out, mean_edge_px
from benchmarks.paper.outcome import Outcome, Table
from benchmarks.paper.shared_runs import the_question
from benchmarks.paper.study import Study
from common.robot.model import RobotModel

__all__ = ["Bitmap", "Maps", "measure", "tool_way"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
SHOWN = ("gamma_som", "gng")  # the paper's two
INTRO = (
    "The question of Table I on the two maps, by the paper's rules and Dijkstra. Each pixel is a neuron: red is blocked by the "
    "question's cells, blue lies on the path; white places have no neuron. γ-SOM: row and column of its lattice. GNG has no lattice: its "
    "neurons are laid onto the bitmap along the two smoothest functions on its graph (eigenvectors of the normalised Laplacian), cut in "
    "halves until each place holds one. *Smoothed* shows the best matches along the smoothed curve."
)


@dataclass(frozen=True, eq=False)
class Bitmap:
    """One map among the question's cells.

    Attributes:
        place: (N, 2) row and column of each neuron; ``side``: of the bitmap.
        blocked: (N,) bool.
        raw, smoothed: neurons on the path, and best matches along the smoothed curve; empty if there is none.
        raw_m, smoothed_m: (K, 3) ways of the tool.
        rejected: no smoothed curve had free best matches, so the raw path is driven.
    """

    model: str
    side: int
    place: I32
    blocked: NDArray[np.bool_]
    raw: I32
    smoothed: I32
    raw_m: F64
    smoothed_m: F64
    rejected: bool


@dataclass(frozen=True, eq=False)
class Maps:
    """All bitmaps, and the boxes (n, 2, 3: lowest and highest corners in metres) that block them."""

    bitmaps: list[Bitmap]
    boxes_m: F64


def tool_way(robot: RobotModel, path_rad: F64) -> F64:
    """(K, 3) positions of the tool along a path (P, J), close enough together to look smooth."""
    if len(path_rad) == 0:
        return np.empty((0, 3))
    parts = [np.linspace(a, b, 12, endpoint=False) for a, b in pairwise(path_rad)]
    poses = robot.joint_poses(np.vstack([*parts, path_rad[-1:]]))[:, -1] @ robot.T_joint_tool
    return np.asarray(poses[:, :3, 3])


def measure(study: Study) -> Outcome:
    """Bitmaps of gamma-SOM and GNG, raw and smoothed."""
    bitmaps, rows = [], []
    for model in study.shown(SHOWN, "bitmaps", len(SHOWN)):
        bitmap, row = _bitmap(study, model)
        bitmaps.append(bitmap)
        rows.append(row)
    columns = ("model", "neurons", "blocked", "on the path", "length raw, rad", "length smoothed, rad", "edge on the bitmap, px")
    cells = [[words.MODEL[str(r["model"])], *(_word(r[k]) for k in list(r)[1:])] for r in rows]
    table = Table(
        "What the bitmaps show", columns, cells, "Edge: mean distance between the pixels of joined neurons; a lattice has 1 to 1.4."
    )
    return Outcome(INTRO, rows=rows, tables=[table], data=Maps(bitmaps, the_question(study).boxes_m))


def _word(value: str | float) -> str:
    return f"{value:.2f}" if isinstance(value, float) else f"{value}"


def _bitmap(study: Study, model: str) -> tuple[Bitmap, dict[str, str | float]]:
    parts, question = study.parts(model), the_question(study)
    planner = parts.motion_planner()
    roadmap = parts.roadmap
    counts = roadmap.counts(parts.grid)
    counts.set_cells(question.cells)
    raw = answer(parts, planner, question, Variant(model, "dijkstra", False, "paper"))
    smooth = answer(parts, planner, question, Variant(model, "dijkstra", True, "paper"))
    along = np.array([planner.finder.best_match(q) for q in smooth.path_rad[::4]], dtype=np.int32)
    unit = study.lattice_unit(model)
    side = study.scale.lattice_side if unit is not None else math.ceil(math.sqrt(roadmap.n_neurons))
    place = lattice_places(unit, side) if unit is not None else lay_out(roadmap, side)
    raw_m, smoothed_m = (tool_way(parts.robot, got.path_rad) for got in (raw, smooth))
    along = along[np.concatenate([[True], np.diff(along) != 0])] if len(along) else along
    row: dict[str, str | float] = {
        "model": model,
        "n_neurons": roadmap.n_neurons,
        "n_blocked": counts.n_blocked,
        "on_path": len(raw.neurons),
        "length_raw_rad": raw.length_rad,
        "length_smoothed_rad": smooth.length_rad,
        "edge_px": mean_edge_px(roadmap, place),
    }
    return Bitmap(model, side, place, counts.node > 0, raw.neurons, along, raw_m, smoothed_m, smooth.fell_back), row
