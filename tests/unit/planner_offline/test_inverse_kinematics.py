from __future__ import annotations

import numpy as np
import pytest

from common.robot.model import RobotModel
from services.planner.core.inverse_kinematics import InverseKinematics
from tests.support import ur_kinematics as ur
from tests.support.cell import ur3

T_WORLD_DH = np.diag([-1.0, -1.0, 1.0, 1.0])  # the URDF's base is turned by half a turn against the table of the data sheet
T_FLANGE_TOOL = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.1], [0, 0, 0, 1]])  # [robot.tool] tcp_position_m


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    return ur3()


def turned(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.abs((a - b + np.pi) % (2 * np.pi) - np.pi).max())


def test_the_referee_has_the_same_arm(robot: RobotModel) -> None:
    for q in np.random.default_rng(1).uniform(-np.pi, np.pi, (20, 6)):
        np.testing.assert_allclose(T_WORLD_DH @ ur.forward(q) @ T_FLANGE_TOOL, robot.tool_pose(q), atol=1e-9)


def test_nearly_all_branches_are_found(robot: RobotModel) -> None:
    solver = InverseKinematics(robot)
    n_wanted = n_found = 0
    for q in np.random.default_rng(0).uniform(-np.pi, np.pi, (200, 6)):
        pose = robot.tool_pose(q)
        wanted = ur.inverse(np.linalg.inv(T_WORLD_DH) @ pose @ np.linalg.inv(T_FLANGE_TOOL))
        found = solver.solve(pose)
        assert len(wanted) >= 2
        n_wanted += len(wanted)
        n_found += sum(any(turned(w, f) < 1e-3 for f in found) for w in wanted)
        assert all(any(turned(w, f) < 1e-3 for w in wanted) for f in found), "a branch that is none"
    assert n_found >= 0.99 * n_wanted


def test_answers_put_the_tool_there_within_limits_without_doubles_and_in_order(robot: RobotModel) -> None:
    solver = InverseKinematics(robot)
    for q in np.random.default_rng(5).uniform(-np.pi, np.pi, (20, 6)):
        pose = robot.tool_pose(q)
        found = solver.solve(pose)
        for i, f in enumerate(found):
            np.testing.assert_allclose(robot.tool_pose(f), pose, atol=1e-8)
            assert robot.limit_violation(f) is None
            assert all(turned(f, other) > 1e-3 for other in found[:i])
        np.testing.assert_array_equal(found, found[np.lexsort(np.round(found, 6).T[::-1])])
        assert InverseKinematics(robot).solve(pose).tobytes() == found.tobytes()


def test_narrow_limits_leave_out_branches(robot: RobotModel) -> None:
    import dataclasses

    low = robot.position_min_rad.copy()
    low[2] = 0.0  # elbow one way only
    narrow = dataclasses.replace(robot, position_min_rad=low)
    pose = robot.tool_pose(robot.home_rad)
    all_of_them, some = InverseKinematics(robot).solve(pose), InverseKinematics(narrow).solve(pose)
    assert 0 < len(some) < len(all_of_them)
    assert np.all(some[:, 2] >= 0.0)


def test_out_of_reach_is_no_answer_and_nonsense_an_error(robot: RobotModel) -> None:
    far = np.eye(4)
    far[:3, 3] = [3.0, 0.0, 0.0]
    assert InverseKinematics(robot).solve(far).shape == (0, 6)
    far[0, 3] = np.nan
    with pytest.raises(ValueError, match="finite 4x4"):
        InverseKinematics(robot).solve(far)
