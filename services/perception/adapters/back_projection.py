"""Depth image to world points by Open3D's tensor pipeline."""

from __future__ import annotations

import numpy as np
import open3d as o3d
from numpy.typing import NDArray

__all__ = ["back_project"]

F64 = NDArray[np.float64]
F32 = NDArray[np.float32]
U16 = NDArray[np.uint16]


def back_project(depth_mm: U16, fx_px: float, fy_px: float, cx_px: float, cy_px: float, T_camera_world: F64, max_range_m: float) -> F32:
    """World points (P, 3) float32 of all pixels of ``depth_mm`` (H, W) that returned something up to ``max_range_m``, in no order."""
    intrinsics = np.array([[fx_px, 0.0, cx_px], [0.0, fy_px, cy_px], [0.0, 0.0, 1.0]])
    cloud = o3d.t.geometry.PointCloud.create_from_depth_image(
        o3d.t.geometry.Image(o3d.core.Tensor.from_numpy(depth_mm)),
        o3d.core.Tensor.from_numpy(intrinsics),
        o3d.core.Tensor.from_numpy(np.ascontiguousarray(T_camera_world)),
        depth_scale=1000.0,
        depth_max=max_range_m,
    )
    points: F32 = cloud.point.positions.numpy()
    return points
