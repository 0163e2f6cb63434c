"""A pinhole depth camera: intrinsics, pose, rays, and the part of its image that a body can appear in."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from common.geometry.transforms import invert
from services.robot_sim.core.camera_kernels import box_of_corners

__all__ = ["CameraModel", "PixelBox", "focal_length_px"]

F64 = NDArray[np.float64]
F32 = NDArray[np.float32]
PixelBox = tuple[int, int, int, int]  # first row, row after the last, first column, column after the last
NEAR_M = 0.01  # nearer than this a corner has no usable projection: the whole image is taken instead; our choice


def focal_length_px(n_pixels: int, field_of_view_deg: float) -> float:
    """Focal length in pixels of ``n_pixels`` that span ``field_of_view_deg``."""
    return n_pixels / 2.0 / math.tan(math.radians(field_of_view_deg) / 2.0)


@dataclass(frozen=True, eq=False)
class CameraModel:
    """One camera. Pixel (u, v) means the ray through its centre; z forward, x right, y down; ``T_world_camera`` (4, 4)."""

    name: str
    width: int
    height: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    T_world_camera: F64

    @staticmethod
    def of_field_of_view(
        name: str, width: int, height: int, horizontal_deg: float, vertical_deg: float, T_world_camera: F64
    ) -> CameraModel:
        """A camera without distortion whose principal point is the middle of the image."""
        fx, fy = focal_length_px(width, horizontal_deg), focal_length_px(height, vertical_deg)
        return CameraModel(name, width, height, fx, fy, (width - 1) / 2.0, (height - 1) / 2.0, T_world_camera)

    @cached_property
    def T_camera_world(self) -> F64:  # noqa: N802 (the field's name)
        """(4, 4) world into the camera's frame."""
        return invert(self.T_world_camera)

    def directions(self) -> F32:
        """(height, width, 3) ray directions in the camera frame with z = 1, so that a ray's parameter is the depth itself."""
        u, v = np.meshgrid(np.arange(self.width), np.arange(self.height))
        x, y = (u - self.cx_px) / self.fx_px, (v - self.cy_px) / self.fy_px
        return np.ascontiguousarray(np.stack([x, y, np.ones_like(x)], axis=-1), dtype=np.float32)

    def pixel_box(self, corners_world_m: F64) -> PixelBox | None:
        """Smallest box of pixels that contains the image of the convex hull of ``corners_world_m`` (C, 3); None if out of view.

        The projection of a convex body lies in the hull of its projected corners as long as all are in front of the camera; a body that
        reaches beside or behind it may appear anywhere.
        """
        R, t = self.T_camera_world[:3, :3], self.T_camera_world[:3, 3]
        intrinsics = (self.fx_px, self.fy_px, self.cx_px, self.cy_px, NEAR_M)
        row0, row1, column0, column1 = box_of_corners(R, t, *intrinsics, self.width, self.height, corners_world_m)
        return None if row0 >= row1 or column0 >= column1 else (row0, row1, column0, column1)
