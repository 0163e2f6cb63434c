"""The fast renderer against one full scene with everything in it."""

from __future__ import annotations

import numpy as np
import pytest

from common.geometry.transforms import look_at, rpy_matrix
from services.robot_sim.adapters.raycast import DepthRenderer
from services.robot_sim.core.camera_model import CameraModel
from services.robot_sim.core.camera_shapes import PlacedShape
from tests.support.eyes import Eyes
from tests.support.full_scene import depth_of, full_scene

SHAPES = [
    PlacedShape("box", (0.1, 0.12, 0.2), rpy_matrix([0.4, 0.0, 0.1], [0.0, 0.3, 0.4])),
    PlacedShape("capsule", (0.04, 0.3), rpy_matrix([-0.1, 0.45, 0.35], [1.2, 0.3, 0.4])),
    PlacedShape("sphere", (0.05,), rpy_matrix([0.1, -0.5, 0.3], [0.0, 0.0, 0.0])),
    PlacedShape("cylinder", (0.05, 0.2), rpy_matrix([-0.35, -0.4, 0.12], [0.2, 0.0, 0.0])),
    PlacedShape("box", (0.3, 0.3, 0.02), rpy_matrix([0.75, 0.75, 0.95], [0.3, 0.0, 0.0])),  # right before a lens: larger than its image
]


@pytest.fixture(scope="module")
def eyes() -> Eyes:
    return Eyes()


def assert_same(fast: np.ndarray, full: np.ndarray, tolerance_m: float) -> None:
    """Equal but for the silhouettes, where the last bit of a ray decides."""
    both = np.isfinite(fast) & np.isfinite(full)
    differs = np.isfinite(fast) != np.isfinite(full)
    differs |= np.where(both, np.abs(np.where(both, fast, 0) - np.where(both, full, 0)), 0) > tolerance_m
    assert differs.sum() <= 6, f"{differs.sum()} of {differs.size} pixels differ"
    assert both.any()


@pytest.mark.parametrize("seed", range(4))
def test_arm_table_and_bins_equal_the_full_scene(eyes: Eyes, seed: int) -> None:
    q = np.random.default_rng(seed).uniform(eyes.robot.position_min_rad, eyes.robot.position_max_rad)
    poses = eyes.robot.joint_poses(q[None])[0]
    scene = full_scene(eyes.robot.bodies, poses, eyes.cell.static, [])
    for camera, fast in zip(eyes.models, eyes.renderer.render(poses, []), strict=True):
        assert_same(fast, depth_of(scene, camera), 2e-5)


def test_every_shape_equals_the_full_scene(eyes: Eyes) -> None:
    poses = eyes.robot.joint_poses(eyes.robot.home_rad[None])[0]
    scene = full_scene(eyes.robot.bodies, poses, eyes.cell.static, SHAPES)
    for camera, fast in zip(eyes.models, eyes.renderer.render(poses, SHAPES), strict=True):
        assert_same(fast, depth_of(scene, camera), 5e-4)  # the full scene's round shapes are polyhedra


def test_the_background_is_not_drawn_upon(eyes: Eyes) -> None:
    poses = eyes.robot.joint_poses(eyes.robot.home_rad[None])[0]
    before = eyes.renderer.render(poses, [])
    eyes.renderer.render(poses, SHAPES)
    for a, b in zip(before, eyes.renderer.render(poses, []), strict=True):
        np.testing.assert_array_equal(a, b)


def test_depth_is_along_the_optical_axis() -> None:
    """A wall across the view has one depth in every pixel."""
    camera = CameraModel.of_field_of_view("c", 40, 30, 87.0, 58.0, look_at([0.0, 0.0, 0.5], [1.0, 0.0, 0.5]))
    wall = PlacedShape("box", (0.1, 10.0, 10.0), rpy_matrix([1.05, 0.0, 0.5], [0.0, 0.0, 0.0]))
    (depth,) = DepthRenderer([camera], [], np.eye(4), []).render(np.eye(4)[None], [wall])
    np.testing.assert_allclose(depth, 1.0, atol=1e-6)


def test_nothing_behind_the_camera_is_seen() -> None:
    camera = CameraModel.of_field_of_view("c", 40, 30, 87.0, 58.0, look_at([0.0, 0.0, 0.5], [1.0, 0.0, 0.5]))
    behind = [PlacedShape(s.shape, s.size_m, rpy_matrix([-0.5, 0.0, 0.5], [0.1, 0.2, 0.3])) for s in SHAPES[:4]]
    (depth,) = DepthRenderer([camera], [], np.eye(4), []).render(np.eye(4)[None], behind)
    assert np.isinf(depth).all()
