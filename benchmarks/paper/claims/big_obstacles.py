"""Claim: the gamma-SOM fails more often than the growing neural gas when obstacles are big."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from benchmarks.paper import words
from benchmarks.paper.ask import RULES, find
from benchmarks.paper.outcome import HOLDS, NOT, NOT_AT_HAND, UNDECIDED, Holds, Outcome, Table, Verdict
from benchmarks.paper.stats import percentile, share
from benchmarks.paper.study import MODELS, Study
from benchmarks.questions import Question
from services.planner.core.check import Checker
from services.planner.core.find import PathFinder, Rules
from services.planner.core.found import FoundPath
from services.planner.core.world import World, cells_of
from services.planner.kernels.collision import FREE
from services.planner.offline.regions import box_cells

__all__ = ["EDGES_M", "Fall", "measure"]

I32 = NDArray[np.int32]
EDGES_M = tuple(
    float(edge) for edge in np.arange(0.08, 0.601, 0.04).round(2)
)  # our choice: from a hand to what fills the room between bins
INTRO = (
    "{n} scenes: start and goal of the set “task”, and a cube at the place of the question's first box that grows from {first:.0f} to "
    "{last:.0f} cm until there is no path, or until it would touch start or goal (then the scene ends without a failure: nobody could "
    "answer). Dijkstra, the search alone; cells that every neuron sweeps are left out. Noted: the share of blocked neurons at which each "
    "map first has no answer. By the paper's rules a blocked best match of start or goal is a failure too."
)


@dataclass(frozen=True)
class Fall:
    """What became of one map in one scene.

    Attributes:
        edge_m: of the cube at which it first failed, or of the last cube if it never did.
        blocked: share of its neurons that were blocked then.
        outcome: why it failed; empty if it never did.
    """

    scene: int
    rules: str
    model: str
    edge_m: float
    blocked: float
    outcome: str

    @property
    def failed(self) -> bool:
        """Whether there was a cube without an answer."""
        return bool(self.outcome)


def measure(study: Study) -> Outcome:
    """All maps by both rules, on the same growing cubes."""
    scenes = study.scenes(study.scale.n_big_scenes)
    finders = {model: study.parts(model).motion_planner().finder for model in MODELS}
    falls = [fall for question in study.shown(scenes, "growing cubes", len(scenes)) for fall in _scene(study, finders, question)]
    tables = [_table(falls)]
    verdicts = [_verdict(falls, rules) for rules in RULES]
    raw = [
        {"row": f"{f.model}-{f.rules}", "question": f.scene, "edge_m": f.edge_m, "blocked_share": f.blocked, "outcome": f.outcome}
        for f in falls
    ]
    intro = INTRO.format(n=len(scenes), first=100 * EDGES_M[0], last=100 * EDGES_M[-1])
    return Outcome(intro, rows=raw, tables=tables, verdicts=verdicts, data=falls)


def _scene(study: Study, finders: dict[str, PathFinder], question: Question) -> list[Fall]:
    parts = study.gng
    cubes = _cubes(study, question, next(iter(finders.values())).checker)
    falls = []
    for model, finder in finders.items():
        roadmap = study.parts(model).roadmap
        counts = roadmap.counts(parts.grid)
        open_rules: list[Rules] = list(RULES)
        blocked = 0.0
        for edge_m, cells in cubes:
            counts.set_cells(cells)
            blocked = counts.n_blocked / roadmap.n_neurons
            world = World.of(parts.grid, counts)
            for rules in list(open_rules):
                found = find(parts, finder, world, question, rules, "dijkstra")
                if not isinstance(found, FoundPath):
                    falls.append(Fall(question.index, rules, model, edge_m, blocked, found.outcome))
                    open_rules.remove(rules)
        last = cubes[-1][0] if cubes else 0.0
        falls += [Fall(question.index, rules, model, last, blocked, "") for rules in open_rules]
    return falls


def _cubes(study: Study, question: Question, checker: Checker) -> list[tuple[float, I32]]:
    """Edges and cells of the growing cube, as long as it touches neither start nor goal."""
    grid, unavoidable = study.gng.grid, study.gng.roadmap.table.unavoidable
    centre = question.boxes_m[0].mean(axis=0)
    cubes = []
    for edge_m in EDGES_M:
        cells = np.setdiff1d(box_cells(grid, centre - edge_m / 2.0, centre + edge_m / 2.0), unavoidable).astype(np.int32)
        world = cells_of(grid, cells)
        if any(checker.pose(world, q)[0] != FREE for q in (question.q_start, question.q_goal)):
            break
        cubes.append((edge_m, cells))
    return cubes


def _table(falls: Sequence[Fall]) -> Table:
    rows = []
    for rules in RULES:
        for model in MODELS:
            mine = [fall for fall in falls if (fall.rules, fall.model) == (rules, model)]
            failed = [fall for fall in mine if fall.failed]
            at = [100.0 * fall.blocked for fall in failed]
            why = ", ".join(f"{outcome} {sum(f.outcome == outcome for f in failed)}" for outcome in sorted({f.outcome for f in failed}))
            quartiles = f"{percentile(at, 50, 1)} ({percentile(at, 25, 1)}–{percentile(at, 75, 1)})"
            edge_cm = percentile([100.0 * fall.edge_m for fall in failed], 50, 0)
            rows.append([words.RULES_WORD[rules], words.MODEL[model], share(len(failed), len(mine)), quartiles, edge_cm, why or "–"])
    columns = ("rules", "model", "scenes with a failure", "blocked at failure, %", "cube at failure, cm", "why")
    return Table("Failures under a growing cube", columns, rows, "Blocked and cube: median (quartiles) over the scenes that failed.")


def _verdict(falls: Sequence[Fall], rules: str) -> Verdict:
    edge = {(f.model, f.scene): f.edge_m if f.failed else np.inf for f in falls if f.rules == rules}
    scenes = sorted({f.scene for f in falls})
    sooner = sum(edge["gamma_som", s] < edge["gng", s] for s in scenes)
    later = sum(edge["gamma_som", s] > edge["gng", s] for s in scenes)
    p = float(binomtest(sooner, sooner + later).pvalue) if sooner + later else 1.0
    n_failed = {model: sum(np.isfinite(edge[model, s]) for s in scenes) for model in ("gamma_som", "gng")}
    said = (
        f"γ-SOM fails in {share(n_failed['gamma_som'], len(scenes))}, GNG in {share(n_failed['gng'], len(scenes))}; on the same scene "
        f"γ-SOM fails at a smaller cube {sooner} times, GNG {later} times (sign test p = {p:.2g})"
    )
    return Verdict(
        f"γ-SOM fails more often at big obstacles ({words.RULES_WORD[rules]} rules)", NOT_AT_HAND, said, _holds(sooner, later, p)
    )


def _holds(sooner: int, later: int, p: float) -> Holds:
    if p >= 0.05:
        return UNDECIDED
    return HOLDS if sooner > later else NOT
