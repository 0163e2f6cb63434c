"""Perception's kernels against their slow twin, whole sets at a time."""

from __future__ import annotations

import numpy as np
import pytest

from common.geometry.transforms import rpy_matrix
from services.robot_sim.core.camera_shapes import PlacedShape
from tests.support.eyes import Eyes
from tests.support.slow_perception import SlowOccupancy

# Odd sizes: the middle of the image is a pixel and no cell projects exactly between two, where the last bit would decide.
SMALL = ["cameras.width=53", "cameras.height=31", "perception.min_points=2"]


@pytest.fixture(scope="module")
def eyes() -> Eyes:
    return Eyes(SMALL)


def random_shapes(rng: np.random.Generator) -> list[PlacedShape]:
    shapes: list[PlacedShape] = []
    for _ in range(rng.integers(0, 4)):
        T = rpy_matrix(rng.uniform([-0.6, -0.6, 0.05], [0.6, 0.6, 0.6]), rng.uniform(-3, 3, 3))
        shapes.append(PlacedShape("box", tuple(rng.uniform(0.08, 0.3, 3)), T))
    return shapes


@pytest.mark.parametrize("seed", range(3))
def test_cells_equal_the_twin_set_by_set(eyes: Eyes, seed: int) -> None:
    rng = np.random.default_rng(seed)
    eyes.forget()
    c = eyes.config
    solids = [s for s in eyes.cell.static if s.name != "table"]
    slow = SlowOccupancy(eyes.grid, solids, eyes.cell.table_z_m, c.sigmas, c.plane_sigmas, eyes.robot.grids, list(eyes.margin), c.rules())
    q = rng.uniform(eyes.robot.position_min_rad, eyes.robot.position_max_rad)
    shapes = random_shapes(rng)
    seen = 0
    for k in range(6):
        if k == 3:
            shapes = shapes[1:]
        q = q + rng.normal(0.0, 0.05, len(q))
        missing = [int(rng.integers(4))] if k % 2 else []
        images = eyes.depth_images(q, shapes)
        exposures = eyes.exposures(q, images, missing)
        slow.joint_poses = eyes.robot.joint_poses(q[None])[0]
        expected = slow.fuse(exposures, k / 15.0)
        np.testing.assert_array_equal(eyes.fuse(exposures, k / 15.0), expected)
        eyes.frame += 1
        seen += len(expected)
    assert seen > 0
