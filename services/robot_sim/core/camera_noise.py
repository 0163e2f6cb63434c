"""What a D435 makes of the true depth: range noise that grows with the square of the distance, and lost pixels along edges.

Depth comes from disparity, z = f b / d, so an error of ``disparity_sigma_px`` becomes sigma(z) = disparity_sigma z^2 / (f b): Intel,
"Best-Known-Methods for Tuning Intel RealSense D400 Depth Cameras for Best Performance", section on RMS depth error. Pixels are
independent of each other here, which a real sensor's are not quite.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from services.robot_sim.core.camera_kernels import degrade

__all__ = ["DepthNoise", "NoiseModel"]

F32 = NDArray[np.float32]
U16 = NDArray[np.uint16]
TABLE_LENGTH = 1 << 20  # numbers drawn once instead of 9 ms of drawing a frame (measured); 4 MB
TABLE_STREAM = 1 << 32  # the key of the table's own numbers, which no camera index reaches


@dataclass(frozen=True)
class NoiseModel:
    """Numbers of one kind of sensor; ``disparity_sigma_px`` = 0 and ``edge_dropout`` = 0 make it perfect (but for the millimetre)."""

    disparity_sigma_px: float
    baseline_m: float
    edge_step: float
    edge_dropout: float
    min_range_m: float
    max_range_m: float


class DepthNoise:
    """Turns true depth images into measured ones; the same seed, camera and frame give the same image.

    One table of normal numbers is drawn from the seed; each frame of each camera reads it from a place of its own, drawn by a generator
    keyed by (seed, camera, frame).
    """

    def __init__(self, model: NoiseModel, seed: int) -> None:
        self._model = model
        self._seed = seed
        generator = np.random.Generator(np.random.Philox(key=[seed, TABLE_STREAM]))
        self._normals = generator.standard_normal(TABLE_LENGTH, dtype=np.float32)
        self._edge_below = float(ndtri(model.edge_dropout))

    def measure(self, depth_m: F32, fx_px: float, camera: int, frame: int) -> U16:
        """``depth_mm`` (H, W), 0 = no return, of the true ``depth_m`` (H, W) with inf where nothing is hit."""
        m = self._model
        place = np.random.Generator(np.random.Philox(key=[self._seed, camera], counter=[0, 0, 0, frame])).integers(TABLE_LENGTH)
        depth_mm = np.empty(depth_m.shape, dtype=np.uint16)
        sigma_per_m2 = m.disparity_sigma_px / (fx_px * m.baseline_m)
        degrade(depth_m, self._normals, int(place), sigma_per_m2, m.edge_step, self._edge_below, m.min_range_m, m.max_range_m, depth_mm)
        return depth_mm
