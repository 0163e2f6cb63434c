"""Where reaching motions begin and end, and what is put in their way: pure draws from a generator."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from common.geometry.grid import Grid
from services.planner.offline.config import RegionConfig

__all__ = ["box_cells", "random_box", "tool_pose_in"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]


def tool_pose_in(region: RegionConfig, rng: np.random.Generator) -> F64:
    """A random ``T_world_tool`` (4, 4): position in the region's box, tool down, turned about the vertical, leaning a little."""
    T = np.eye(4)
    T[:3, 3] = rng.uniform(region.min_m, region.max_m)
    turn, lean_towards = rng.uniform(-region.turn_max_rad, region.turn_max_rad), rng.uniform(-np.pi, np.pi)
    lean = rng.uniform(0.0, region.tilt_max_rad) * np.array([np.cos(lean_towards), np.sin(lean_towards), 0.0])
    down = Rotation.from_euler("x", np.pi)
    T[:3, :3] = (Rotation.from_rotvec(lean) * Rotation.from_euler("z", turn) * down).as_matrix()
    return T


def random_box(centre_m: F64, box_min_m: float, box_max_m: float, rng: np.random.Generator) -> tuple[F64, F64]:
    """Lowest and highest corner (3,) of a box of random sizes about ``centre_m``, along the world's axes."""
    half = 0.5 * rng.uniform(box_min_m, box_max_m, size=3)
    return centre_m - half, centre_m + half


def box_cells(grid: Grid, low_m: F64, high_m: F64) -> I32:
    """Ascending flat indices of the cells that a box touches; the part outside the grid is left out."""
    origin, shape = np.asarray(grid.origin_m), np.asarray(grid.shape)
    first = np.clip(np.floor((low_m - origin) / grid.resolution_m).astype(np.int64), 0, shape)
    last = np.clip(np.ceil((high_m - origin) / grid.resolution_m).astype(np.int64), 0, shape)
    ranges = [np.arange(a, b) for a, b in zip(first, last, strict=True)]
    x, y, z = np.meshgrid(*ranges, indexing="ij")
    return np.asarray(((x * shape[1] + y) * shape[2] + z).ravel(), dtype=np.int32)
