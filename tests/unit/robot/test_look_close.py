"""The closer look at a distance grid: never above the truth, mostly within half a millimetre, and as its slow twin has it."""

from __future__ import annotations

import coal
import numpy as np
import pytest

from common.robot.kernels import FAR, body_distance, body_grid, look_close, look_near
from common.robot.model import RobotModel, load_robot
from common.robot.pairs import coal_mesh
from common.robot.solids import Body, box_mesh, build_grids
from tests.support.cell import ur3_cell
from tests.support.slow_planner import slow_close

HALF_M = np.array([0.03, 0.02, 0.05])
BODIES = (Body("box", 1, *box_mesh(2.0 * HALF_M), False),)
ANY = (-np.inf, np.inf)  # a closer look is wanted in any case


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    return load_robot(ur3_cell().robot)


def test_on_the_arm_it_is_never_above_the_truth_and_close_to_it(robot: RobotModel) -> None:
    rng = np.random.default_rng(0)
    point, still = coal.Sphere(1e-6), coal.Transform3s()
    gaps = []
    for b, body in enumerate(robot.bodies):
        mesh, grid = coal_mesh(body), body_grid(robot.grids, b)
        for p in rng.uniform(body.vertices.min(axis=0) - 0.03, body.vertices.max(axis=0) + 0.03, size=(200, 3)):
            there = coal.Transform3s(np.eye(3), p)
            true = coal.distance(mesh, still, point, there, coal.DistanceRequest(), coal.DistanceResult())
            if body_distance(robot.grids, b, *p) < 0.0 or true > 0.035:
                continue  # inside coal's meshes know surfaces only
            told = look_close(robot.grids.distance, grid, *p, *ANY)
            assert look_near(robot.grids.distance, grid, *p) <= told <= true + 1e-4
            gaps.append(true - told)
    assert len(gaps) > 400 and np.median(gaps) < 0.0005 and np.mean(gaps) < 0.001


@pytest.mark.parametrize("voxel_m", [0.005, 0.0025])
def test_it_equals_its_twin_inside_and_outside_and_at_the_rim(voxel_m: float) -> None:
    grids = build_grids(BODIES, voxel_m)
    grid = body_grid(grids, 0)
    for p in np.random.default_rng(2).uniform(-HALF_M - 0.08, HALF_M + 0.08, size=(3000, 3)):
        assert look_close(grids.distance, grid, *p, *ANY) == pytest.approx(slow_close(grids, 0, p), abs=1e-12)
    assert look_close(grids.distance, grid, 1.0, 0.0, 0.0, *ANY) == FAR


def test_where_the_first_look_decides_the_closer_one_would_decide_the_same(robot: RobotModel) -> None:
    rng = np.random.default_rng(3)
    b, grids = 2, robot.grids
    grid = body_grid(grids, b)
    low_p, high_p = grids.box_min_m[b] - 0.04, grids.box_max_m[b] + 0.04
    n_spared = 0
    for p in rng.uniform(low_p, high_p, size=(5000, 3)):
        low = rng.uniform(0.0, 0.04)
        high = low + rng.uniform(0.0, 0.01)
        told, close = look_close(grids.distance, grid, *p, low, high), look_close(grids.distance, grid, *p, *ANY)
        assert (told > high) == (close > high) and (told <= low) == (close <= low)
        n_spared += told < close
    assert n_spared > 1000
