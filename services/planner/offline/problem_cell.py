"""The cell in which problems of a file are planned: the arm of a cell config alone, with a gripper, on a grid about its reach."""

from __future__ import annotations

import math
from itertools import product

import msgspec
import numpy as np

from common.cell import CellConfig, GridConfig, SolidConfig, ToolConfig
from common.robot.model import RobotModel, load_robot
from services.planner.config import MarginsConfig, PlannerConfig

__all__ = ["problem_cell"]

SAMPLES = 20_000  # of the arm's poses; our choice: a stretched UR5 is met to 3 cm
SEED = 0
ROOM_M = 0.05  # our choice, see SAMPLES


def problem_cell(cell: CellConfig, config: PlannerConfig) -> tuple[CellConfig, PlannerConfig]:
    """Cell and planner config for problems, by ``[planner.problems]``: nothing is bolted down, every solid of a scene becomes cells.

    Raises:
        RobotError: the robot cannot be loaded.
    """
    p = config.problems
    x, y, z = p.gripper_m
    box = SolidConfig(name="gripper", shape="box", size_m=[x, y, z], position_m=(0.0, 0.0, z / 2.0))
    tool = ToolConfig(solids=[box], tcp_position_m=(0.0, 0.0, z))
    robot = msgspec.structs.replace(cell.robot, tool=tool, voxel_m=p.voxel_m)
    bare = msgspec.structs.replace(cell, robot=robot, static=[], poses={})
    margins = MarginsConfig(safety_m=p.safety_m, step_m=p.step_m, table_step_m=p.table_step_m, static_m=p.clearance_m, self_m=p.self_m)
    changed = msgspec.structs.replace(
        config,
        margins=margins,
        map=msgspec.structs.replace(config.map, n_neurons=p.n_neurons),
        motions=msgspec.structs.replace(config.motions, n_samples=p.n_samples, seed=p.seed, n_workers=p.n_workers),
    )
    return msgspec.structs.replace(bare, grid=_reachable(load_robot(robot), p.resolution_m)), changed


def _reachable(robot: RobotModel, resolution_m: float) -> GridConfig:
    """The grid about the first joint that holds all that the arm can reach, found by sampling, with room for what no sample met."""
    middle_m = robot.chain.base_rotation @ robot.chain.translation[0] + robot.chain.base_translation
    q = np.random.default_rng(SEED).uniform(robot.position_min_rad, robot.position_max_rad, size=(SAMPLES, robot.n_joints))
    frames = robot.joint_poses(q)
    reach_m = 0.0
    for body, low, high in zip(robot.bodies, robot.grids.box_min_m, robot.grids.box_max_m, strict=True):
        corners = np.array(list(product(*zip(low, high, strict=True))))
        turn, shift = frames[:, body.joint, :3, :3], frames[:, body.joint, :3, 3]
        places = np.einsum("kab,cb->kca", turn, corners) + shift[:, None]
        reach_m = max(reach_m, float(np.linalg.norm(places - middle_m, axis=2).max()))
    n = 2 * math.ceil((reach_m + ROOM_M) / resolution_m)
    x, y, z = (float(round(round(m / resolution_m) * resolution_m - n / 2 * resolution_m, 6)) for m in middle_m)
    return GridConfig(origin_m=(x, y, z), shape=(n, n, n), resolution_m=resolution_m)
