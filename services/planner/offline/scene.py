"""The part of the world that never changes, as offline work needs it: arm, static layer, grid, limits, safety distance."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from common.cell import CellConfig
from common.geometry.grid import Grid
from common.robot.model import RobotModel, load_robot
from common.robot.payload import Payload, with_payload
from services.planner.config import MarginsConfig
from services.planner.core.arm import arm_of, solids_of
from services.planner.core.check import Checker
from services.planner.core.rrt_connect import RrtConnect, RrtParameters
from services.planner.core.world import cells_of
from services.planner.kernels.collision import Arm
from services.planner.kernels.rrt_connect import World
from services.planner.kernels.static_layer import Solids

__all__ = ["Scene"]

I32 = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Scene:
    """Robot, grid, static layer and margins of one cell."""

    robot: RobotModel
    grid: Grid
    arm: Arm
    solids: Solids
    margins: MarginsConfig

    @staticmethod
    def of(cell: CellConfig, margins: MarginsConfig) -> Scene:
        """The scene of a cell config.

        Raises:
            RobotError: the robot cannot be loaded.
        """
        robot = load_robot(cell.robot)
        arm = arm_of(robot, static_margin_m=margins.static_m, self_margin_m=margins.self_m)
        return Scene(robot, Grid.of(cell.grid), arm, solids_of(cell.static), margins)

    def holding(self, payload: Payload) -> Scene:
        """The same for an arm that holds a box; about half a second.

        Raises:
            RequestError: the box cannot be held.
        """
        robot, m = with_payload(self.robot, payload), self.margins
        return replace(self, robot=robot, arm=arm_of(robot, static_margin_m=m.static_m, self_margin_m=m.self_m))

    def checker(self) -> Checker:
        """The one check for this arm, with its own scratch; without names of static shapes."""
        bodies = [body.name for body in self.robot.bodies]
        solids = [f"static shape {i}" for i in range(len(self.solids.kind))]
        m = self.margins
        return Checker(self.arm, self.solids, safety_m=m.safety_m, step_m=m.step_m, body_names=bodies, solid_names=solids)

    def planner(self, parameters: RrtParameters | None = None) -> RrtConnect:
        """A sampling planner for this arm, with its own scratch."""
        return RrtConnect(self.arm, self.solids, self.robot.position_min_rad, self.robot.position_max_rad, parameters)

    def world(self, planner: RrtConnect, cells: I32) -> World:
        """What ``planner``'s motions are checked against when ``cells`` (C,) are occupied."""
        return planner.world(cells_of(self.grid, cells), self.margins.safety_m)
