"""Other arms than the UR3, all the way: model, inverse kinematics, a small map, a plan, and the same arm in the physics engine."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from clients.cli.main import main
from common import cell
from common.cell import CellConfig
from common.config import config_of_robot
from common.geometry.transforms import quaternion_of
from common.robot.model import RobotModel, load_robot
from common.wire.messages import PlanRequest, Pose, SetGoal
from services.planner.config import PlannerConfig
from services.planner.core.inverse_kinematics import InverseKinematics
from services.planner.core.world import no_cells
from services.planner.kernels.collision import FREE
from services.planner.offline.ask import plan_offline
from services.planner.offline.regions import tool_pose_in
from services.planner.offline.scene import Scene
from services.robot_sim.adapters.bullet import World

# Seven joints and meshes; a description of our own out of solids. Loading the others takes a minute each and shows nothing else.
ARMS = ("panda", "ur3e")
SMALL = [
    "planner.map.n_neurons=100",
    "planner.motions.n_trajectories=10",
    "planner.motions.n_samples=600",
    "planner.motions.n_workers=1",
    "planner.learning.keep=false",
]


@dataclass(frozen=True, eq=False)
class Loaded:
    cell: CellConfig
    config: PlannerConfig
    robot: RobotModel


@cache
def load(name: str) -> Loaded:
    shared, config = cell.load(config_of_robot(name), "planner", PlannerConfig)
    return Loaded(shared, config, load_robot(shared.robot))


@pytest.mark.parametrize("name", ARMS)
def test_home_is_free_and_the_regions_are_in_reach(name: str) -> None:
    arm = load(name)
    scene = Scene.of(arm.cell, arm.config.margins)
    checker, nothing = scene.checker(), no_cells(scene.grid)
    assert checker.pose(nothing, arm.robot.home_rad)[0] == FREE
    inverse, rng = InverseKinematics(arm.robot), np.random.default_rng(0)
    for region in (arm.config.motions.pick, arm.config.motions.place):
        found = [inverse.solve(tool_pose_in(region, rng)) for _ in range(20)]
        assert sum(any(checker.pose(nothing, q)[0] == FREE for q in branches) for branches in found) >= 8


def test_a_redundant_arm_has_many_ways_to_reach_a_pose() -> None:
    robot = load("panda").robot
    inverse = InverseKinematics(robot)
    for q in np.random.default_rng(3).uniform(robot.position_min_rad, robot.position_max_rad, (10, 7)):
        pose = robot.tool_pose(q)
        found = inverse.solve(pose)
        assert len(found) >= 4
        for i, one in enumerate(found):
            np.testing.assert_allclose(robot.tool_pose(one), pose, atol=1e-8)
            assert robot.limit_violation(one) is None
            assert all(np.abs(one - other).max() > 1e-3 for other in found[:i])
        assert InverseKinematics(robot).solve(pose).tobytes() == found.tobytes()


@pytest.mark.parametrize("name", ARMS)
def test_a_small_map_is_built_and_plans(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["build", "--robot", name, *(f"--set={override}" for override in SMALL)]) == 0
    assert "neurons                  100" in capsys.readouterr().out
    arm = load(name)
    region = arm.config.motions.place
    scene = Scene.of(arm.cell, arm.config.margins)
    checker, nothing, rng = scene.checker(), no_cells(scene.grid), np.random.default_rng(1)
    inverse = InverseKinematics(arm.robot)
    drawn = (tool_pose_in(region, rng) for _ in range(50))
    pose = next(T for T in drawn if any(checker.pose(nothing, q)[0] == FREE for q in inverse.solve(T)))
    goal = SetGoal(pose=Pose(position_m=pose[:3, 3].tolist(), quaternion_xyzw=quaternion_of(pose).tolist()))
    reply = plan_offline(config_of_robot(name), SMALL, PlanRequest(goal=goal))
    assert reply.outcome == "path", reply.reason
    assert np.allclose(arm.robot.tool_pose(reply.path_q_rad[-1]), pose, atol=1e-6)


@pytest.mark.parametrize("name", ARMS)
def test_physics_has_the_same_arm(name: str) -> None:
    arm = load(name)
    with World(arm.robot, arm.cell.static, 0.004) as world:
        for q in np.random.default_rng(4).uniform(arm.robot.position_min_rad, arm.robot.position_max_rad, (5, arm.robot.n_joints)):
            world.reset(q)
            assert np.abs(world.frame_poses() - arm.robot.joint_poses(q[None])[0, 1:]).max() < 1e-6
            assert np.allclose(world.joints()[0], q)
