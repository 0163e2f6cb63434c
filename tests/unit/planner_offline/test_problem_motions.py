"""Training motions of problems: made, kept, moved."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from common.cell import CellConfig, SolidConfig
from common.robot.model import RobotModel, load_robot
from services.planner.config import PlannerConfig
from services.planner.offline.config import MotionsConfig, ProblemsConfig
from services.planner.offline.exercises import exercises_of_problems
from services.planner.offline.motion_store import make_motions
from services.planner.offline.problem_cell import problem_cell
from services.planner.offline.problem_motions import ProblemMotionMaker, ProblemOrder, TrainingProblem, training_problems
from services.planner.offline.problems import Problem
from services.planner.offline.scene import Scene
from tests.support.cell import ur3_cell
from tests.unit.planner_offline.conftest import PICK, PLACE

POST = SolidConfig(name="post", shape="box", size_m=[0.05, 0.05, 0.8], position_m=(0.35, 0.0, 0.2))
CONFIG = ProblemsConfig(motions_per_problem=3, random_share=0.67, n_workers=1, voxel_m=0.005)


def problem(index: int, pan_rad: float) -> Problem:
    tail = [-1.2, 1.4, -1.8, -1.5708, 0.0]
    return Problem("posts", index, np.array([-0.9, *tail]), np.array([pan_rad, *tail]), (POST,))


@pytest.fixture(scope="module")
def cell() -> CellConfig:
    return problem_cell(ur3_cell(), PlannerConfig(motions=MotionsConfig(pick=PICK, place=PLACE), problems=CONFIG))[0]


@pytest.fixture(scope="module")
def robot(cell: CellConfig) -> RobotModel:
    return load_robot(cell.robot)


@pytest.fixture(scope="module")
def order(cell: CellConfig, tmp_path_factory: pytest.TempPathFactory) -> ProblemOrder:
    config = problem_cell(ur3_cell(), PlannerConfig(motions=MotionsConfig(pick=PICK, place=PLACE), problems=CONFIG))[1]
    both = tuple(training_problems([problem(1, 0.9), problem(2, 1.1)]))
    return ProblemOrder(cell, config.margins, CONFIG, both, tmp_path_factory.mktemp("motions"), "of these")


def test_the_grid_holds_the_arm_wherever_it_goes(cell: CellConfig, robot: RobotModel) -> None:
    low = np.array(cell.grid.origin_m)
    high = low + np.array(cell.grid.shape) * cell.grid.resolution_m
    q = np.random.default_rng(5).uniform(robot.position_min_rad, robot.position_max_rad, size=(2000, robot.n_joints))
    q = np.vstack([q, [[0, 0, 0, 0, 0, 0], [0, -np.pi / 2, 0, -np.pi / 2, 0, 0]]])  # stretched out, and up
    frames = robot.joint_poses(q)
    for body in robot.bodies:
        turn, shift = frames[:, body.joint, :3, :3], frames[:, body.joint, :3, 3]
        places = np.einsum("kab,vb->kva", turn, body.vertices[::7]) + shift[:, None]
        assert np.all(places > low) and np.all(places < high), body.name
    assert cell.static == [] and robot.bodies[-1].name == "tool"
    assert np.allclose(np.ptp(robot.bodies[-1].vertices, axis=0).max(), 0.14)


def test_an_end_that_all_share_stays_and_others_move_with_the_scene() -> None:
    shared, moved = training_problems([problem(1, 0.9), problem(2, 1.1)]), training_problems([problem(1, 0.9)])
    assert [(t.start_moves, t.goal_moves) for t in [*shared, *moved]] == [(False, True)] * 3
    assert len({t.digest for t in shared}) == 2 and shared[0].digest == moved[0].digest


def test_motions_are_free_of_the_true_shapes(order: ProblemOrder) -> None:
    maker = order.maker()
    given = maker.motion(0)
    assert np.array_equal(given[0], problem(1, 0.9).q_start) and np.array_equal(given[-1], problem(1, 0.9).q_goal)
    assert len(given) > 2  # round the post
    from benchmarks.referee import Referee, at_steps  # judged by who shares no code with the planner

    assert not Referee(load_robot(order.cell.robot), [POST]).collides(at_steps(given), np.empty((0, 2, 3)))


def test_a_moved_scene_moves_goal_and_shapes_together(order: ProblemOrder, robot: RobotModel) -> None:
    maker = ProblemMotionMaker(Scene.of(order.cell, order.margins), CONFIG, order.problems)
    training: TrainingProblem = order.problems[0]
    moved = maker._moved(training, np.random.default_rng(3))
    assert moved is not None and np.array_equal(moved.q_start, training.problem.q_start)
    was, now = robot.tool_pose(training.problem.q_goal)[:3, 3], robot.tool_pose(moved.q_goal)[:3, 3]
    post_was, post_now = np.array(POST.position_m), np.array(moved.solids[0].position_m)
    assert np.linalg.norm(now - was) > 0.005
    assert np.isclose(np.linalg.norm(now - post_now), np.linalg.norm(was - post_was))  # rigid
    assert abs(post_now[2] - post_was[2]) <= CONFIG.shift_max_m


def test_motions_of_a_problem_do_not_depend_on_the_others_and_are_kept(order: ProblemOrder) -> None:
    made = make_motions(order, lambda _share: None)
    assert len(made) == 6 and all(len(path) >= 2 for path in made)
    alone = ProblemOrder(order.cell, order.margins, CONFIG, order.problems[1:], order.directory / "alone", order.fingerprint)
    assert all(np.array_equal(a, b) for a, b in zip(make_motions(alone, lambda _share: None), made[3:], strict=True))
    stamps = {path: path.stat().st_mtime_ns for path in Path(order.directory).glob("*.tolman")}
    assert len(stamps) == 2
    again = make_motions(order, lambda _share: None)
    assert all(np.array_equal(a, b) for a, b in zip(made, again, strict=True))
    assert all(path.stat().st_mtime_ns == stamp for path, stamp in stamps.items())


def test_a_problem_without_solution_gives_no_motion(order: ProblemOrder) -> None:
    wall = SolidConfig(name="wall", shape="box", size_m=[3.0, 0.05, 3.0], position_m=(0.0, 0.2, 0.0))
    closed = Problem("walls", 1, order.problems[0].problem.q_start, order.problems[0].problem.q_goal, (wall,))
    maker = ProblemMotionMaker(Scene.of(order.cell, order.margins), CONFIG, training_problems([closed]))
    assert maker.motion(0).shape == (0, 6)


def test_exercises_are_the_scenes_moved_as_cells(order: ProblemOrder) -> None:
    exercises, again = (exercises_of_problems(order.maker(), 0) for _ in range(2))
    drawn = [exercises(k) for k in range(12)]
    asked = [exercise for exercise in drawn if exercise is not None]
    assert len(asked) >= 4 and all(len(exercise.cells) > 50 for exercise in asked)
    assert len({exercise.cells.tobytes() for exercise in asked}) == len(asked)
    for k in (7, 2):
        one, other = drawn[k], again(k)
        assert (one is None) == (other is None)
        assert one is None or other is None or one.cells.tobytes() + one.q_goal.tobytes() == other.cells.tobytes() + other.q_goal.tobytes()
