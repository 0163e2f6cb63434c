from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from common.geometry.grid import Grid
from common.robot.model import RobotModel
from services.planner.core.arm import arm_of, solids_of
from services.planner.core.check import Checker
from services.planner.core.world import no_cells
from services.planner.kernels.collision import FREE
from tests.support.cell import ur3, ur3_cell


@dataclass(frozen=True, eq=False)
class Bench:
    """A UR3 in its cell, and free poses to work with."""

    robot: RobotModel
    grid: Grid
    checker: Checker
    free_rad: np.ndarray


@pytest.fixture(scope="session")
def bench() -> Bench:
    cell, robot = ur3_cell(), ur3()
    checker = Checker(
        arm_of(robot, static_margin_m=0.01, self_margin_m=0.005),
        solids_of(cell.static),
        safety_m=0.02,
        step_m=0.01,
        body_names=[body.name for body in robot.bodies],
        solid_names=[solid.name for solid in cell.static],
    )
    grid = Grid.of(cell.grid)
    drawn = np.random.default_rng(11).uniform(robot.position_min_rad, robot.position_max_rad, size=(400, 6))
    nothing = no_cells(grid)
    free = np.array([q for q in drawn if checker.pose(nothing, q)[0] == FREE])
    return Bench(robot, grid, checker, free)
