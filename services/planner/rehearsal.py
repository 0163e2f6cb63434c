"""Goes once through everything that a live planner does, so that every kernel is compiled before the first goal counts.

A kernel that compiles in the middle of a dodge costs seconds; numba's cache makes the next start quick.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from common.errors import TolmanError
from common.geometry.transforms import quaternion_of
from common.robot.payload import Payload
from common.wire.messages import PlanRequest, Pose, SetGoal
from services.planner.assemble import Parts
from services.planner.core.cognitive_map import CognitiveMap
from services.planner.core.found import NO_NEURON, FoundPath
from services.planner.core.growth import Addition, grown
from services.planner.core.layers import build_layers
from services.planner.core.lookup import build_table, cells_of_pose
from services.planner.core.motion import Ask, Motion, Stopwatch
from services.planner.core.repair import Repair, tightened
from services.planner.core.roadmap import Roadmap
from services.planner.core.timing import brake
from services.planner.core.two_trees import Bounds, Joined, seed_of
from services.planner.core.world import World, cells_of
from services.planner.learner import Lesson, Student
from services.planner.questions import QuestionDesk

__all__ = ["rehearse", "rehearse_holding", "rehearse_learning"]

REPAIR_SAMPLES = 60

F64 = NDArray[np.float64]


def rehearse(parts: Parts, clock_ns: Callable[[], int]) -> None:
    """Ask by joints and by pose, plan among cells, leave in motion, come out from among cells, brake."""
    desk = QuestionDesk(parts, clock_ns)
    home = parts.robot.home_rad
    tool = parts.robot.tool_pose(home)
    pose = Pose(position_m=tool[:3, 3].tolist(), quaternion_xyzw=quaternion_of(tool).tolist())
    far = parts.roadmap.neurons_rad[int(np.argmax(np.linalg.norm(parts.roadmap.neurons_rad - home, axis=1)))]
    scattered = np.arange(0, parts.grid.n_cells, 997, dtype=np.int32)
    for goal in (SetGoal(q_rad=far), SetGoal(pose=pose)):
        for search in ("dijkstra", "bidirectional", "wavefront"):  # A* is the kernel of Dijkstra
            for cells in (scattered, np.empty(0, dtype=np.int32)):
                desk.answer(PlanRequest(q_start_rad=far, goal=goal, search=search), home, cells)
                desk.answer(PlanRequest(q_start_rad=home, goal=SetGoal(q_rad=far), search=search), home, cells)
    _move(parts, clock_ns, home, far)
    _repair(parts, clock_ns, home, far)


def _repair(parts: Parts, clock_ns: Callable[[], int], home: F64, far: F64) -> None:
    """On a map without free edges, so that there is something to search for, in a few samples; and cut corners."""
    planner, vision = parts.motion_planner(), parts.reflex(clock_ns, "rehearsal").vision
    vision.counts.edge[:] = 1
    joint_range = (parts.robot.position_min_rad, parts.robot.position_max_rad)
    few = Bounds(REPAIR_SAMPLES, slice_iterations=REPAIR_SAMPLES, connections=1)
    repair = Repair(planner.finder, vision.world, home, far[None], joint_range, seed_of(home, far), few, 1, planner.pool)
    while repair.advance() is True:
        pass
    tightened(planner.checker, vision.world.cells, Joined(np.array([home, home + 0.01, home]), np.full(1, NO_NEURON, dtype=np.int32)))


def _move(parts: Parts, clock_ns: Callable[[], int], home: F64, far: F64) -> None:
    planner, watch = parts.motion_planner(), Stopwatch(clock_ns)
    vision = parts.reflex(clock_ns, "rehearsal").vision
    motion = planner.answer(vision.world, Ask(home, far), watch)
    if not isinstance(motion, Motion):
        return
    curve = motion.curve
    q, dq, _ = curve.sample(curve.duration_s / 2.0)
    planner.answer(vision.world, Ask(q, far, dq), watch)
    brake(curve, curve.duration_s / 2.0, parts.limits, 0.1)
    checker = planner.checker
    swept = cells_of_pose(checker.arm, parts.grid, q, safety_m=checker.safety_m)
    checker.curve_meets(cells_of(parts.grid, swept[:8]), curve)
    checker.clearance(vision.seen, q)
    outer = np.setdiff1d(swept, cells_of_pose(checker.arm, parts.grid, q, safety_m=0.0))[:4]
    vision.see(0.0, outer.astype(np.int32))
    checker.hand_meets(vision.world.recent, curve, parts.hand)
    planner.answer(World.of(parts.grid, vision.counts), Ask(q, far), watch)
    vision.see(0.1, np.empty(0, dtype=np.int32))
    corner = FoundPath(np.full(1, NO_NEURON, dtype=np.int32), np.array([home, home + 0.1, far]))
    planner.refined(vision.world, Ask(home, far), replace(motion, path=corner), watch)


def rehearse_learning(student: Student, parts: Parts) -> None:
    """Learn along an edge that is there and grow by a neuron on it. Nothing is kept."""
    roadmap = parts.roadmap
    if roadmap.n_edges:
        ends = roadmap.edges[0]
        path = roadmap.neurons_rad[ends]
        with suppress(TolmanError):
            student.take_in(Lesson(path), rehearsal=True)
        n = roadmap.n_neurons
        grown(roadmap, Addition(path.mean(axis=0)[None], np.array([[ends[0], n], [ends[1], n]], dtype=np.int32)), parts.ground)


def rehearse_holding(parts: Parts) -> None:
    """Get ready for a box on a map of two neurons, that then grows by one."""
    q = parts.roadmap.neurons_rad[:2]
    learned = CognitiveMap(np.ascontiguousarray(q), np.array([[0, 1]], dtype=np.int32)[: len(q) - 1])
    ground = parts.ground
    table = build_table(ground.arm, ground.grid, learned.q_rad, learned.edges, safety_m=ground.safety_m, step_m=ground.step_m)
    if ground.layers is not None:
        table = replace(table, layers=build_layers(ground.layers, learned.q_rad, learned.edges))
    two = parts.on(Roadmap.of(learned, table, parts.roadmap.model))
    three = parts.on(grown(two.roadmap, Addition(q.mean(axis=0)[None], np.array([[0, 2]], dtype=np.int32)), ground))
    with suppress(TolmanError):
        three.holding(two.load(Payload((0.04, 0.04, 0.04))).on(three.roadmap))
