"""One exposure of one camera as the kernels want it, and the check that keeps a broken one out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["CameraView", "Optics", "problem_of_exposure", "sigma_per_m2"]

F64 = NDArray[np.float64]
U16 = NDArray[np.uint16]
MAX_SIDE_PX = 4096  # our choice: beyond any depth sensor, and no payload may cost more than a frame's time
RIGID_TOLERANCE = 1e-3  # of R^T R against the identity; our choice, loose enough for float32 poses


class Optics(NamedTuple):
    """The numbers of a camera."""

    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    sigma_per_m2: float  # sigma(z) = sigma_per_m2 z^2
    min_range_m: float  # nearer things give no return


class CameraView(NamedTuple):
    """A depth image with its pinhole: pixel (u, v) of depth z is the point ``rotation @ (x z, y z, z) + translation``.

    Kernels take the arrays out of the tuples before their loops: inside, each access would count references (measured: 13 times slower).
    """

    optics: Optics
    rotation: F64  # (3, 3) world <- camera
    translation: F64  # (3,) the camera's place in the world
    bit: int  # 1 << index of the camera
    depth_mm: U16  # (H, W), 0 = no return


def sigma_per_m2(disparity_sigma_px: float, fx_px: float, baseline_m: float) -> float:
    """Range noise of a stereo camera, sigma(z) = this times z^2 (Intel's D400 tuning guide)."""
    return disparity_sigma_px / (fx_px * baseline_m)


def problem_of_exposure(
    width: int, height: int, fx_px: float, fy_px: float, cx_px: float, cy_px: float, T_world_camera: F64, depth_mm: U16
) -> str | None:
    """What makes an exposure unusable, naming the value; None if nothing does."""
    if not (0 < width <= MAX_SIDE_PX and 0 < height <= MAX_SIDE_PX):
        return f"image of {width} x {height} pixels"
    if depth_mm.shape != (height, width):
        return f"depth_mm has shape {depth_mm.shape}, width and height say {(height, width)}"
    if not (np.isfinite([fx_px, fy_px, cx_px, cy_px]).all() and fx_px > 0.0 and fy_px > 0.0):
        return f"intrinsics {(fx_px, fy_px, cx_px, cy_px)} are not those of a camera"
    if T_world_camera.shape != (4, 4) or not np.isfinite(T_world_camera).all():
        return "T_world_camera must be a finite 4x4 matrix"
    R = T_world_camera[:3, :3]
    rigid = np.abs(R.T @ R - np.eye(3)).max() < RIGID_TOLERANCE and np.linalg.det(R) > 0.0
    if not rigid or not np.array_equal(T_world_camera[3], [0.0, 0.0, 0.0, 1.0]):
        return "T_world_camera is not a rigid transform"
    return None
