"""The arm as the demo needs it: where its tool is, how fast, and how far it is from a box."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.robot.model import RobotModel

__all__ = ["Arm"]

F64 = NDArray[np.float64]
SPEED_STEP_S = 1e-4  # of the difference quotient
FAIRNESS_STEP_S = 0.1  # our choice: between two looks into the arm's near future


class Arm:
    """Geometry of a robot model, by its sphere cover."""

    def __init__(self, model: RobotModel) -> None:
        self.model = model
        grids = model.grids
        n_spheres = np.diff(grids.group_sphere_offset)
        n_groups = np.diff(grids.group_offset)
        joint_of_group = np.repeat(grids.body_joint, n_groups)
        self._joint_of_sphere = np.repeat(joint_of_group, n_spheres)
        self._spheres_m = grids.spheres_m

    def tool_positions(self, q_rad: F64) -> F64:
        """(K, 3) positions of the tool for ``q_rad`` (K, J)."""
        poses: F64 = self.model.joint_poses(q_rad)[:, -1] @ self.model.T_joint_tool
        return poses[:, :3, 3]

    def tool_speeds(self, q_rad: F64, dq_rad_s: F64) -> F64:
        """(K,) speeds of the tool in m/s for (K, J) positions and velocities."""
        ahead = self.tool_positions(q_rad + SPEED_STEP_S * dq_rad_s)
        speeds: F64 = np.linalg.norm(ahead - self.tool_positions(q_rad), axis=1) / SPEED_STEP_S
        return speeds

    def distance_to_box(self, q_rad: F64, size_m: list[float], centre_m: list[float]) -> float:
        """Least distance in metres (lower bound) between the arm at any row of ``q_rad`` (K, J) and an upright box."""
        frames = self.model.joint_poses(q_rad)[:, self._joint_of_sphere]
        centres = np.einsum("ksab,sb->ksa", frames[..., :3, :3], self._spheres_m[:, :3]) + frames[..., :3, 3]
        outside = np.maximum(np.abs(centres - np.asarray(centre_m)) - np.asarray(size_m) / 2.0, 0.0)
        return float((np.linalg.norm(outside, axis=-1) - self._spheres_m[:, 3]).min())

    def keeps_clear_of(self, q_rad: F64, dq_rad_s: F64, size_m: list[float], centre_m: list[float], horizon_s: float) -> float:
        """Least distance to a box now and on the way that the arm would make within ``horizon_s`` at its present velocity."""
        times = np.arange(0.0, horizon_s + 1e-9, FAIRNESS_STEP_S)
        return self.distance_to_box(q_rad + times[:, None] * dq_rad_s, size_m, centre_m)
