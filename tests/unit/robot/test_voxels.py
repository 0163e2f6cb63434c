"""Finer voxels of the distance grids: the same distances near a body, lower bounds of them beyond."""

from __future__ import annotations

import numpy as np
import pytest

from common.robot.kernels import body_distance
from common.robot.solids import Body, box_mesh, build_grids

HALF_M = np.array([0.03, 0.02, 0.05])
BODIES = (Body("box", 1, *box_mesh(2.0 * HALF_M), False),)


def box_distance(points: np.ndarray) -> np.ndarray:
    beyond = np.abs(points) - HALF_M
    return np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)


@pytest.mark.parametrize("voxel_m", [0.005, 0.0025, 0.002])
def test_a_grid_never_tells_more_than_the_true_distance_and_near_the_body_little_less(voxel_m: float) -> None:
    grids = build_grids(BODIES, voxel_m)
    points = np.random.default_rng(1).uniform(-HALF_M - 0.05, HALF_M + 0.05, size=(4000, 3))
    told = np.array([body_distance(grids, 0, *p) for p in points])
    true = box_distance(points)
    assert np.all(told <= true + 1e-9)
    assert np.all((true - told)[np.abs(true) < 0.02] <= voxel_m * np.sqrt(3.0) + 2e-4)
    assert np.all(true - told <= 0.025)


def test_the_spheres_do_not_depend_on_the_voxels() -> None:
    coarse, fine = build_grids(BODIES, 0.005), build_grids(BODIES, 0.0025)
    for name in ("spheres_m", "group_m", "part_m"):
        np.testing.assert_array_equal(getattr(coarse, name), getattr(fine, name))
