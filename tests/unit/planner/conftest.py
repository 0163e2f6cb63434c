from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial import KDTree

from common.geometry.grid import Grid
from common.robot.model import RobotModel
from services.planner.core.arm import arm_of, solids_of
from services.planner.core.check import Checker
from services.planner.core.cognitive_map import CognitiveMap
from services.planner.core.find import PathFinder
from services.planner.core.lookup import BlockedCounts, build_table
from services.planner.core.roadmap import Roadmap
from services.planner.core.world import World, cells_of, no_cells
from services.planner.kernels.collision import FREE
from services.planner.offline.regions import box_cells
from tests.support.cell import ur3, ur3_cell

N_CUT = 40
LOW, HIGH = np.array([-1.2, -2.0, 0.4, -2.4, -2.0, -0.5]), np.array([1.2, -0.8, 2.0, -0.8, -1.0, 0.5])


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


@pytest.fixture(scope="session")
def cut(bench: Bench) -> tuple[PathFinder, World, list[tuple[np.ndarray, np.ndarray]]]:
    """A map of poses over the table, a wall before the arm, and pairs of free poses whose straight way is not free."""
    rng = np.random.default_rng(5)
    checker = bench.checker
    wall = box_cells(bench.grid, np.array([0.2, -0.05, 0.0]), np.array([0.7, 0.05, 0.4])).astype(np.int32)
    seen, empty = cells_of(bench.grid, wall), no_cells(bench.grid)
    table_free = [q for q in rng.uniform(LOW, HIGH, size=(300, 6)) if checker.pose(seen, q)[0] == FREE]
    q = np.array(table_free[:N_CUT])
    _, near = KDTree(q).query(q, k=4)
    edges = np.array([(i, j) for i in range(N_CUT) for j in near[i, 1:] if q[i, 0] * q[j, 0] > 0 and checker.segment(empty, q[i], q[j])])
    assert len(edges), "two parts, left and right"
    learned = CognitiveMap.of(q, edges)
    table = build_table(checker.arm, bench.grid, learned.q_rad, learned.edges, safety_m=0.02, step_m=0.01)
    counts = BlockedCounts(table, N_CUT, len(learned.edges))
    counts.set_cells(wall)
    world = World.of(bench.grid, counts)
    pairs = [(a, b) for a, b in itertools.pairwise(table_free[N_CUT:]) if not checker.segment(world.cells, a, b)]
    return PathFinder(Roadmap.of(learned, table, "gng"), checker), world, pairs
