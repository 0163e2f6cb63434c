"""The scenes of the clutter experiment: a number of boxes about the way, or a gap to reach into."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from benchmarks.paper.study import Study
from benchmarks.questions import Question
from common.geometry.transforms import pose_matrix
from services.planner.core.check import Checker
from services.planner.core.inverse_kinematics import InverseKinematics
from services.planner.core.world import cells_of
from services.planner.kernels.collision import FREE
from services.planner.offline.regions import box_cells, random_box

__all__ = ["clutter", "gap_question"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
BOX_MIN_M, BOX_MAX_M = 0.06, 0.20  # our choice: from a hand to a crate
SPREAD_M = 0.12  # of a box's centre about the way of the arm; our choice
DRAWS = 60  # of a box until one leaves start and goal free
WALL_M = 0.06  # thickness of the gap's two walls; our choice
WALL_X_M, WALL_Z_M = (0.22, 0.42), (0.0, 0.22)  # their extent: as long as a bin, as high as the gripper when it is down in the gap
GOAL_M = (0.32, 0.30, 0.13)  # x, y about which the gap lies, height of the tool in it: 9 cm deep, nearly all of the gripper; our choice
SHRINK_M = 1e-4  # walls end on cell borders; a rounding must not make them touch the next cells
YAWS = 12  # turns of the tool that are tried for a goal in the gap
STREAM = 71  # of the generator, so that other parts draw other numbers


def clutter(study: Study, n_boxes: int, n_scenes: int) -> Iterator[Question]:
    """Questions with start and goal of the set “task” and ``n_boxes`` boxes near the way that leave both free."""
    for question in study.scenes(n_scenes):
        rng = np.random.default_rng([study.seed, STREAM, n_boxes, question.index])
        yield _with_boxes(study, question, n_boxes, rng)


def _with_boxes(study: Study, question: Question, n_boxes: int, rng: np.random.Generator) -> Question:
    robot, checker = study.gng.robot, study.once("checker", study.gng.checker)
    boxes: list[F64] = []
    for _ in range(n_boxes):
        for _ in range(DRAWS):
            frames = robot.joint_poses((question.q_start + rng.random() * (question.q_goal - question.q_start))[None])[0]
            places = np.vstack([frames[len(frames) // 2 :, :3, 3], (frames[-1] @ robot.T_joint_tool)[:3, 3]])
            centre = places[rng.integers(len(places))] + rng.normal(scale=SPREAD_M, size=3)
            box = np.array(random_box(centre, BOX_MIN_M, BOX_MAX_M, rng))
            if _both_free(checker, study, question, _cells(study, np.array([box]))):
                boxes.append(box)
                break
    placed = np.array(boxes).reshape(-1, 2, 3)
    return Question(question.index, question.q_start, question.q_goal, placed, _cells(study, placed))


def _both_free(checker: Checker, study: Study, question: Question, cells: I32) -> bool:
    world = cells_of(study.gng.grid, cells)
    return all(checker.pose(world, q)[0] == FREE for q in (question.q_start, question.q_goal))


def _cells(study: Study, boxes_m: F64) -> I32:
    if len(boxes_m) == 0:
        return np.empty(0, dtype=np.int32)
    cells = np.unique(np.concatenate([box_cells(study.gng.grid, low, high) for low, high in boxes_m]))
    return np.setdiff1d(cells, study.gng.roadmap.table.unavoidable).astype(np.int32)


def gap_question(study: Study, gap_m: float, scene: Question) -> Question | None:
    """Reach into a gap of a width between two walls, from that end of ``scene`` which lies farther from it; None if no pose in "
    "the gap keeps the distances."""
    grid = study.gng.grid
    cell_m = grid.resolution_m
    left = round((GOAL_M[1] - gap_m / 2.0) / cell_m) * cell_m
    walls = np.array(
        [
            [[WALL_X_M[0], y, WALL_Z_M[0]], [WALL_X_M[1], y + WALL_M, WALL_Z_M[1]]]
            for y in (left - WALL_M, left + round(gap_m / cell_m) * cell_m)
        ]
    )
    walls[:, 0] += SHRINK_M
    walls[:, 1] -= SHRINK_M
    cells = _cells(study, walls)
    checker, world = study.once("checker", study.gng.checker), cells_of(grid, cells)
    goals = _goals(study, (GOAL_M[0], left + gap_m / 2.0, GOAL_M[2]))
    free = [q for q in goals if checker.pose(world, q)[0] == FREE]
    start = _farther_end(study, scene)
    if not free or checker.pose(world, start)[0] != FREE:
        return None
    goal = min(free, key=lambda q: float(np.linalg.norm(q - start)))
    return Question(scene.index, start, goal, walls, cells)


def _farther_end(study: Study, scene: Question) -> F64:
    """Start or goal of a scene, whose tool is farther from the gap: the one over the other bin."""
    robot = study.gng.robot
    ends = (scene.q_start, scene.q_goal)
    places = (robot.joint_poses(np.array(ends))[:, -1] @ robot.T_joint_tool)[:, :3, 3]
    return ends[int(np.argmax(np.linalg.norm(places - np.array(GOAL_M), axis=1)))]


def _goals(study: Study, position_m: tuple[float, float, float]) -> list[F64]:
    """Joint vectors with the tool straight down at a place, in several turns."""
    inverse = study.once("inverse kinematics", lambda: InverseKinematics(study.gng.robot))
    found: list[F64] = []
    for yaw in np.arange(YAWS) * np.pi / YAWS:  # the gripper is the same after half a turn
        quaternion = [np.cos(yaw / 2.0), np.sin(yaw / 2.0), 0.0, 0.0]  # turned about the vertical, then down
        found += list(inverse.solve(pose_matrix(list(position_m), quaternion)))
    return found
