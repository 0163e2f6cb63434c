"""What is known to be there: the table plane and the bolted-down solids. Their surface is never a cell.

A point within the range noise of the table plane is table, below it nothing. Range noise moves a point along its ray, so its part along
the plane's normal is sigma(z) times the ray's slope. The bound is the larger of ``sigmas`` sigma(z) (the design's rule) and
``plane_sigmas`` times that part (steep rays, where the first would let noise through).

**The lowest thing that can be seen** is therefore max(sigmas, plane_sigmas slope) sigma(z) above the table (:func:`lowest_visible_m`).
With the UR3 cell's cameras: 24 mm in the middle of the table, where all four are equally far, down to 14 mm towards its corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from common.cell import SolidConfig
from common.geometry.grid import Grid
from common.geometry.transforms import rpy_matrix
from services.perception.core.background_kernels import BOX, CYLINDER, LARGEST_BOUND_M, SPHERE, flag_near_solids

__all__ = ["Background", "BackgroundRules", "background_of", "lowest_visible_m"]

F64 = NDArray[np.float64]
KINDS = {"box": BOX, "sphere": SPHERE, "cylinder": CYLINDER}


class BackgroundRules(NamedTuple):
    """The numbers of the background."""

    table_z_m: float
    sigmas: float
    plane_sigmas: float


class Background(NamedTuple):
    """Table and S solids, for kernels."""

    rules: BackgroundRules
    solids: F64  # (S, 16): kind, three sizes as in :class:`common.cell.SolidConfig`, rotation world <- solid by rows, translation
    near: NDArray[np.uint8]  # (cells,) 1 where a point of the cell can be within the largest bound of a solid


def background_of(grid: Grid, table_z_m: float, solids: Sequence[SolidConfig], sigmas: float, plane_sigmas: float) -> Background:
    """The background of a cell. Solids that lie wholly below the table plane need no test of their own."""
    rows = [_row(s) for s in solids if not _below(s, table_z_m)]
    table = np.array(rows, dtype=np.float64).reshape(-1, 16)
    near = np.zeros(grid.n_cells, dtype=np.uint8)
    reach = LARGEST_BOUND_M + grid.resolution_m * np.sqrt(3.0) / 2.0
    flag_near_solids(table, grid.centres(np.arange(grid.n_cells)), reach, near)
    return Background(BackgroundRules(table_z_m, sigmas, plane_sigmas), table, near)


def lowest_visible_m(
    camera_position_m: F64, depth_m: float, point_m: F64, sigma_per_m2: float, sigmas: float, plane_sigmas: float
) -> float:
    """Height above the table below which a point seen at ``depth_m`` by a camera counts as table."""
    slope = abs(float(camera_position_m[2] - point_m[2])) / depth_m
    return min(max(sigmas, plane_sigmas * slope) * sigma_per_m2 * depth_m**2, LARGEST_BOUND_M)


def _row(solid: SolidConfig) -> F64:
    T = rpy_matrix(solid.position_m, solid.rpy_rad)
    size = [*solid.size_m, 0.0, 0.0][:3]
    return np.array([KINDS[solid.shape], *size, *T[:3, :3].ravel(), *T[:3, 3]])


def _below(solid: SolidConfig, table_z_m: float) -> bool:
    half = np.asarray(solid.size_m) / 2.0 if solid.shape == "box" else np.full(3, max(solid.size_m))
    rotation = rpy_matrix(solid.position_m, solid.rpy_rad)[:3, :3]
    return bool(solid.position_m[2] + np.abs(rotation[2]) @ half <= table_z_m + 1e-9)
