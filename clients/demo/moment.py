"""Keeps the moment that the picture will show: obstacles seen, a path round them planned, part of it driven."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.robot.trajectory import JointTrajectory
from common.wire.messages import Message, RobotState, Trajectory, VoxelFrame

__all__ = ["Moment", "MomentKeeper"]

F64 = NDArray[np.float64]
TRAIL_NS = 6_000_000_000  # our choice: how much of the driven path is shown
SAMPLE_GAP_NS = 40_000_000
PLANNED_SAMPLES = 80
DRIVEN_SHARE = 0.45  # our choice: of the planned curve, so that both colours are seen


@dataclass(frozen=True, eq=False)
class Moment:
    """What the picture shows: the arm (J,), occupied cells' centres (C, 3) with their edge, planned and driven joint paths (K, J)."""

    q_rad: F64
    cells_m: F64
    resolution_m: float
    planned_q_rad: F64
    driven_q_rad: F64


class MomentKeeper:
    """Watches the bus and keeps the best moment so far: the one with most cells seen and most of a long way planned."""

    def __init__(self) -> None:
        self.best: Moment | None = None
        self._best_score = 0.0
        self._trail: deque[tuple[int, F64]] = deque()
        self._voxels: VoxelFrame | None = None
        self._trajectory: Trajectory | None = None

    def observe(self, message: Message) -> None:
        """Take in one message of any channel."""
        if isinstance(message, VoxelFrame):
            self._voxels = message
        elif isinstance(message, Trajectory):
            self._trajectory = message
        elif isinstance(message, RobotState):
            self._observe_robot(message)

    def _observe_robot(self, state: RobotState) -> None:
        if self._trail and state.stamp_ns - self._trail[-1][0] < SAMPLE_GAP_NS:
            return
        self._trail.append((state.stamp_ns, state.q_rad))
        while state.stamp_ns - self._trail[0][0] > TRAIL_NS:
            self._trail.popleft()
        trajectory = self._trajectory
        if trajectory is None or trajectory.kind != "motion" or trajectory.id != state.trajectory_id or self._voxels is None:
            return
        duration_s = float(trajectory.t_s[-1])
        if state.trajectory_time_s < DRIVEN_SHARE * duration_s:
            return
        way_rad = float(np.abs(np.diff(trajectory.q_rad, axis=0)).sum())
        score = way_rad * len(self._voxels.cells)
        if score > self._best_score:
            self._best_score = score
            self.best = self._moment(state, trajectory, self._voxels)

    def _moment(self, state: RobotState, trajectory: Trajectory, voxels: VoxelFrame) -> Moment:
        curve = JointTrajectory(trajectory.t_s, trajectory.q_rad, trajectory.dq_rad_s)
        planned, _, _ = curve.sample(np.linspace(0.0, curve.duration_s, PLANNED_SAMPLES))
        shape, origin = voxels.grid.shape, np.asarray(voxels.grid.origin_m)
        ijk = np.stack(np.unravel_index(voxels.cells, shape), axis=-1)
        cells_m = origin + (ijk + 0.5) * voxels.grid.resolution_m
        driven = np.array([q for _, q in self._trail])
        return Moment(state.q_rad, cells_m, voxels.grid.resolution_m, planned, driven)
