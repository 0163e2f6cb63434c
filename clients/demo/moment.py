"""Keeps the moment that the picture will show: obstacles seen, a path round them planned, part of it driven."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from clients.demo.arm import Arm
from common.robot.trajectory import JointTrajectory
from common.wire.messages import Message, RobotState, Trajectory, VoxelFrame

__all__ = ["Moment", "MomentKeeper"]

F64 = NDArray[np.float64]
SAMPLE_GAP_NS = 40_000_000
TRAIL_SAMPLES = 250  # ten seconds
PLANNED_SAMPLES = 80
DRIVEN_SHARE = (0.3, 0.7)  # our choice: of the planned curve, so that both colours are seen
NEAR_M = 0.20  # our choice: cells this near to the tool's way are what it goes round


@dataclass(frozen=True, eq=False)
class Moment:
    """What the picture shows: the arm (J,), occupied cells' centres (C, 3) with their edge, planned and driven joint paths (K, J)."""

    q_rad: F64
    cells_m: F64
    resolution_m: float
    planned_q_rad: F64
    driven_q_rad: F64


class MomentKeeper:
    """Watches the bus and keeps the best moment so far: a long way planned, half of it driven, with many cells close to it."""

    def __init__(self, arm: Arm) -> None:
        self.best: Moment | None = None
        self._arm = arm
        self._best_score = -1.0  # so that the first candidate counts, even without a cell
        self._trail: deque[F64] = deque(maxlen=TRAIL_SAMPLES)
        self._last_sample_ns = 0
        self._voxels: VoxelFrame | None = None
        self._trajectory: Trajectory | None = None

    def observe(self, message: Message) -> None:
        """Take in one message of any channel."""
        if isinstance(message, VoxelFrame):
            self._voxels = message
        elif isinstance(message, Trajectory):
            if self._trajectory is None or message.goal_id != self._trajectory.goal_id:
                self._trail.clear()
            self._trajectory = message
        elif isinstance(message, RobotState) and message.stamp_ns - self._last_sample_ns >= SAMPLE_GAP_NS:
            self._last_sample_ns = message.stamp_ns
            self._trail.append(message.q_rad)
            self._weigh(message)

    def _weigh(self, state: RobotState) -> None:
        trajectory, voxels = self._trajectory, self._voxels
        if (
            trajectory is None
            or voxels is None
            or trajectory.kind != "motion"
            or trajectory.id != state.trajectory_id
            or not len(voxels.cells)
        ):
            return
        share = state.trajectory_time_s / float(trajectory.t_s[-1])
        if not DRIVEN_SHARE[0] <= share <= DRIVEN_SHARE[1]:
            return
        curve = JointTrajectory(trajectory.t_s, trajectory.q_rad, trajectory.dq_rad_s)
        planned, _, _ = curve.sample(np.linspace(0.0, curve.duration_s, PLANNED_SAMPLES))
        way_m = self._arm.tool_positions(planned)
        cells_m = _centres(voxels)
        n_near = int((cdist(cells_m, way_m).min(axis=1, initial=np.inf) < NEAR_M).sum())
        score = n_near * float(np.linalg.norm(np.diff(way_m, axis=0), axis=1).sum())
        if score > self._best_score:
            self._best_score = score
            self.best = Moment(state.q_rad, cells_m, voxels.grid.resolution_m, planned, np.array(self._trail))


def _centres(voxels: VoxelFrame) -> F64:
    ijk = np.stack(np.unravel_index(voxels.cells, voxels.grid.shape), axis=-1)
    centres_m: F64 = np.asarray(voxels.grid.origin_m) + (ijk + 0.5) * voxels.grid.resolution_m
    return centres_m
