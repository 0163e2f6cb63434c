"""Exact distances by coal on the bare meshes."""

from __future__ import annotations

import coal
import numpy as np

from common.robot.model import RobotModel
from common.robot.pairs import coal_mesh

__all__ = ["cube_distance_m"]


def cube_distance_m(robot: RobotModel, q_rad: np.ndarray, centre_m: np.ndarray, half_m: float) -> float:
    """Distance of the moving bodies at ``q_rad`` (J,) to the cube around ``centre_m`` (3,); negative inside."""
    cube, placed = coal.Box(*[2.0 * half_m] * 3), coal.Transform3s(np.eye(3), centre_m)
    frames = robot.joint_poses(q_rad[None])[0]
    return min(
        coal.distance(
            coal_mesh(body),
            coal.Transform3s(np.ascontiguousarray(frames[body.joint][:3, :3]), frames[body.joint][:3, 3]),
            cube,
            placed,
            coal.DistanceRequest(),
            coal.DistanceResult(),
        )
        for body in robot.bodies
        if not body.immobile
    )
