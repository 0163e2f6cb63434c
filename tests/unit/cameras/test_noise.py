"""The D435's depth law, lost edges, range, and that a seed says it all."""

from __future__ import annotations

import numpy as np
import pytest

from services.robot_sim.core.camera_kernels import degrade
from services.robot_sim.core.camera_noise import DepthNoise, NoiseModel
from tests.support import slow_sensor

MODEL = NoiseModel(disparity_sigma_px=0.04, baseline_m=0.05, edge_step=0.05, edge_dropout=0.5, min_range_m=0.175, max_range_m=3.0)
FX = 223.0


def flat(depth_m: float) -> np.ndarray:
    return np.full((240, 424), depth_m, dtype=np.float32)


@pytest.mark.parametrize("depth_m", [0.5, 1.0, 2.0])
def test_sigma_grows_with_the_square_of_the_distance(depth_m: float) -> None:
    depth_mm = DepthNoise(MODEL, 0).measure(flat(depth_m), FX, 0, 0)
    sigma_mm = 1000 * 0.04 * depth_m**2 / (FX * 0.05)
    error = depth_mm.astype(float) - 1000 * depth_m
    assert abs(error.mean()) < 0.05 * sigma_mm
    assert error.std() == pytest.approx(np.hypot(sigma_mm, np.sqrt(1 / 12)), rel=0.02)  # rounding to the millimetre on top


def test_same_seed_camera_and_frame_give_the_same_image_and_nothing_else_does() -> None:
    image = flat(1.0)
    reference = DepthNoise(MODEL, 7).measure(image, FX, 1, 5)
    np.testing.assert_array_equal(DepthNoise(MODEL, 7).measure(image, FX, 1, 5), reference)
    for seed, camera, frame in ((8, 1, 5), (7, 2, 5), (7, 1, 6)):
        assert (DepthNoise(MODEL, seed).measure(image, FX, camera, frame) != reference).mean() > 0.5


def test_edges_drop_out_by_their_share_and_nothing_else_does() -> None:
    image = flat(2.0)
    image[:, 100:200] = 1.0
    depth_mm = DepthNoise(MODEL, 0).measure(image, FX, 0, 0)
    edge = np.zeros(image.shape, bool)
    edge[:, [99, 100, 199, 200]] = True
    assert (depth_mm[~edge] > 0).all()
    assert (depth_mm[edge] == 0).mean() == pytest.approx(0.5, abs=0.06)


def test_out_of_range_and_nothing_there_give_no_return() -> None:
    image = flat(1.0)
    image[0, :4] = [0.1, 3.5, np.inf, -1.0]
    depth_mm = DepthNoise(MODEL, 0).measure(image, FX, 0, 0)
    assert (depth_mm[0, :4] == 0).all()


@pytest.mark.parametrize("seed", range(3))
def test_kernel_equals_its_twin(seed: int) -> None:
    rng = np.random.default_rng(seed)
    depth = rng.choice([0.5, 1.0, 1.02, 2.0, np.inf], size=(12, 17)).astype(np.float32)
    normals = rng.standard_normal(300, dtype=np.float32)
    out = np.empty(depth.shape, np.uint16)
    arguments = (depth, normals, int(rng.integers(300)), 0.01, 0.05, 0.3, 0.175, 1.9)
    degrade(*arguments, out)
    np.testing.assert_array_equal(out, slow_sensor.degrade(*arguments))
