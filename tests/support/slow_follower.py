"""Slow and obvious twin of the follower: numeric Jacobian, scipy's rotations, one step after the other."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from common.robot.model import RobotModel

__all__ = ["slow_step"]


def slow_step(
    robot: RobotModel, q: np.ndarray, dq: np.ndarray, T_hand: np.ndarray, *, step_s: float, pull_per_s: float, damping: float, share: float
) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity one step later of an arm far from its position limits; ``share`` of its speed and acceleration limits."""

    def pose(at: np.ndarray) -> tuple[np.ndarray, Rotation]:
        T = robot.tool_pose(at)
        return T[:3, 3], Rotation.from_matrix(T[:3, :3])

    place, turn = pose(q)
    pull = np.concatenate([T_hand[:3, 3] - place, (Rotation.from_matrix(T_hand[:3, :3]) * turn.inv()).as_rotvec()])
    jacobian = np.empty((6, len(q)))
    for j in range(len(q)):
        tiny = np.eye(len(q))[j] * 1e-6
        (p_up, r_up), (p_down, r_down) = pose(q + tiny), pose(q - tiny)
        jacobian[:3, j], jacobian[3:, j] = (p_up - p_down) / 2e-6, (r_up * r_down.inv()).as_rotvec() / 2e-6
    wanted = jacobian.T @ np.linalg.inv(jacobian @ jacobian.T + damping**2 * np.eye(6)) @ (pull_per_s * pull)
    wanted /= max(1.0, np.max(np.abs(wanted) / (share * robot.max_velocity_rad_s)))
    most = share * robot.max_acceleration_rad_s2 * step_s
    after = dq + np.clip(wanted - dq, -most, most)
    return q + (dq + after) / 2 * step_s, after
