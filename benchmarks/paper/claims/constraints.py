"""Claim: a constraint can be learned from data alone: a map of motions that keep the tool upright plans motions that do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.paper import words
from benchmarks.paper.ask import RULES, Variant, answer
from benchmarks.paper.claims.level_motions import LevelMotions, tilt_deg
from benchmarks.paper.maps import kept_map
from benchmarks.paper.outcome import HOLDS, IN_PART, NOT, NOT_AT_HAND, UNDECIDED, Holds, Outcome, Table, Verdict
from benchmarks.paper.stats import percentile, share
from benchmarks.paper.study import Study
from benchmarks.questions import Question
from benchmarks.referee import at_steps
from services.planner.assemble import Parts
from services.planner.core.cognitive_map import CognitiveMap
from services.planner.core.gng import GrowingNeuralGas
from services.planner.core.world import cells_of
from services.planner.kernels.collision import FREE
from services.planner.offline.growth import gas_parameters
from services.planner.offline.motions import resample
from services.planner.offline.regions import box_cells, random_box

__all__ = ["Tilts", "measure"]

F64 = NDArray[np.float64]
STREAM = 83  # of the generator, so that other parts draw other numbers
LOOK_RAD = 1.0 / 64.0  # joint step at which the tilt is looked at: between neurons too
KEPT_DEG = 10.0  # our choice: a plan within so much keeps the orientation, as a cup two thirds full would want
BOX_MIN_M, BOX_MAX_M, SPREAD_M = 0.08, 0.18, 0.06  # of the one box near the way; our choice
DRAWS = 40
LEANS_DEG = (0.0, 30.0)  # straight down, as the demo grasps; and leaning, which is harder, see INTRO. Our choice
INTRO = (
    "{motions} motions from bin to bin whose tool axis keeps its direction all the way (turning about it is free) train a gas of "
    "{neurons} neurons; nothing else says that the direction matters, and no edge is added afterwards. {plans} plans between the ends of "
    "further such motions, a box near the way in each, on this map and on the shipped one, which knows nothing of it. *Tilt*: angle "
    "between the tool's axis and the direction to be kept, looked at every 1/64 rad along what would be driven, so between neurons too. "
    "Straight down is a flat subspace of this arm's joint space (two sums of joints are constant), so a straight line between two such "
    "neurons keeps it by itself; leaning by 30° towards one side of the world is curved there, and is the harder test."
)


@dataclass(frozen=True, eq=False)
class Tilts:
    """One way of planning: largest tilt of each plan in degrees, and all looks of all plans."""

    lean_deg: float
    map_name: str
    how: str
    n_asked: int
    worst_deg: tuple[float, ...]
    looks_deg: F64


def measure(study: Study) -> Outcome:
    """Tilts on both maps, raw and smoothed, for both directions."""
    found: list[Tilts] = []
    notes = []
    for lean_deg in LEANS_DEG:
        level = LevelMotions(study, lean_deg)
        maps = {"constrained": _constrained(study, level), "unconstrained": study.gng}
        questions = _questions(study, level)
        found += [
            _tilts(study, parts, questions, lean_deg, name, Variant("gng", "dijkstra", smooth, rules))
            for name, parts in maps.items()
            for rules in RULES
            for smooth in (False, True)
        ]
        notes.append(_edges_word(maps["constrained"], lean_deg))
    columns = ("lean, °", "map", "plan", "solved", "tilt p95, °", "tilt max, °", f"plans within {KEPT_DEG:.0f}°")
    note = (
        f"Along the edges of the constrained maps themselves: {'; '.join(notes)}. By our rules a free straight joint line is preferred "
        "to the map, and corners are cut: both leave what the data taught."
    )
    raw = [
        {"row": f"{t.lean_deg:g} {t.map_name} {t.how}", "plan": k, "worst_tilt_deg": worst}
        for t in found
        for k, worst in enumerate(t.worst_deg)
    ]
    scale = study.scale
    intro = INTRO.format(motions=scale.n_constraint_motions, neurons=scale.constraint_neurons, plans=scale.n_plans)
    verdicts = [_verdict([t for t in found if t.lean_deg == lean_deg]) for lean_deg in LEANS_DEG]
    return Outcome(
        intro, rows=raw, tables=[Table("Tilt of the tool", columns, [_row(t) for t in found], note)], verdicts=verdicts, data=found
    )


def _row(t: Tilts) -> list[str]:
    return [
        f"{t.lean_deg:.0f}",
        t.map_name,
        t.how,
        share(len(t.worst_deg), t.n_asked),
        percentile(t.looks_deg, 95, 1),
        f"{float(np.max(t.looks_deg)):.1f}" if len(t.looks_deg) else "–",
        share(sum(worst <= KEPT_DEG for worst in t.worst_deg), len(t.worst_deg)),
    ]


def _edges_word(parts: Parts, lean_deg: float) -> str:
    """Tilt along a map's edges, five looks each."""
    neurons, edges = parts.roadmap.neurons_rad, parts.roadmap.edges
    looks = np.concatenate([tilt_deg(parts.robot, np.linspace(neurons[a], neurons[b], 5), lean_deg) for a, b in edges])
    return f"lean {lean_deg:.0f}° p95 {percentile(looks, 95, 1)}°, max {float(looks.max()):.1f}°"


def _constrained(study: Study, level: LevelMotions) -> Parts:
    scale, config = study.scale, study.config.map

    def learn() -> CognitiveMap:
        drawn = (
            level.motion(np.random.default_rng([study.config.motions.seed, STREAM, k, int(level.lean_deg)]))
            for k in range(scale.n_constraint_motions)
        )
        paths = [path for path in study.shown(drawn, "level motions", scale.n_constraint_motions) if path is not None]
        samples = resample(paths, 8 * scale.constraint_neurons)
        gas = GrowingNeuralGas(gas_parameters(config), scale.constraint_neurons)
        return gas.fit(samples.q_rad, samples.starts, config.seed, lambda done: study.tell("level map", done)).to_map()

    inputs = [STREAM, level.lean_deg, scale.n_constraint_motions, scale.constraint_neurons, config.seed]
    return study.on(kept_map(study.job, "level", inputs, learn, study.tell).roadmap("gng"))


def _questions(study: Study, level: LevelMotions) -> list[Question]:
    checker, grid, robot = study.gng.checker(), study.gng.grid, study.gng.robot
    questions = []
    for k in range(study.scale.n_plans):
        rng = np.random.default_rng([study.seed, STREAM + 1, k, int(level.lean_deg)])
        start, goal = level.ends(rng)
        boxes, cells = np.empty((0, 2, 3)), np.empty(0, dtype=np.int32)
        for _ in range(DRAWS):
            tool = (robot.joint_poses((start + rng.random() * (goal - start))[None])[0, -1] @ robot.T_joint_tool)[:3, 3]
            box = np.array(random_box(tool + rng.normal(scale=SPREAD_M, size=3), BOX_MIN_M, BOX_MAX_M, rng))
            touched = np.setdiff1d(box_cells(grid, *box), study.gng.roadmap.table.unavoidable).astype(np.int32)
            if all(checker.pose(cells_of(grid, touched), q)[0] == FREE for q in (start, goal)):
                boxes, cells = box[None], touched
                break
        questions.append(Question(k, start, goal, boxes, cells))
    return questions


def _tilts(study: Study, parts: Parts, questions: Sequence[Question], lean_deg: float, name: str, variant: Variant) -> Tilts:
    planner = parts.motion_planner()
    how = f"{words.RULES_WORD[variant.rules]} rules, {'smoothed' if variant.smooth else 'raw'}"
    looks = []
    for question in study.shown(questions, f"{name}, {how}", len(questions)):
        got = answer(parts, planner, question, variant)
        if got.solved:
            looks.append(tilt_deg(parts.robot, at_steps(got.path_rad, LOOK_RAD), lean_deg))
    every = np.concatenate(looks) if looks else np.empty(0)
    return Tilts(lean_deg, name, how, len(questions), tuple(float(look.max()) for look in looks), every)


def _verdict(found: Sequence[Tilts]) -> Verdict:
    raw = {t.map_name: t for t in found if t.how.startswith("paper") and t.how.endswith("raw")}
    mine, other = raw["constrained"], raw["unconstrained"]
    holds: Holds = UNDECIDED
    if mine.worst_deg and other.worst_deg:
        kept = [np.mean([worst <= KEPT_DEG for worst in t.worst_deg]) for t in (mine, other)]
        holds = (
            HOLDS
            if kept[0] == 1.0 > kept[1]
            else IN_PART
            if np.percentile(mine.looks_deg, 95) < np.percentile(other.looks_deg, 95)
            else NOT
        )
    said = "; ".join(
        f"{t.map_name}: p95 {percentile(t.looks_deg, 95, 1)}°, max {float(np.max(t.looks_deg)):.1f}° over {len(t.worst_deg)} plans"
        for t in raw.values()
        if t.worst_deg
    )
    word = (
        f"*Holds* means: every plan within {KEPT_DEG:.0f}° and not so without the data. Meant are raw paths by the paper's rules; the "
        "table has the rest."
    )
    direction = "straight down" if mine.lean_deg == 0.0 else f"leaning {mine.lean_deg:.0f}°"
    return Verdict(f"Constraints can be taught by data: plans keep the wrist's orientation ({direction})", NOT_AT_HAND, said, holds, word)
