"""The cell grid: cubic cells, flat indices with x slowest and z fastest (C order)."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from common.cell import GridConfig

__all__ = ["Grid"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]


@dataclass(frozen=True)
class Grid:
    """Cells of edge ``resolution_m`` from ``origin_m`` (the lowest corner), ``shape`` cells along x, y, z; world frame."""

    origin_m: tuple[float, float, float]
    shape: tuple[int, int, int]
    resolution_m: float

    @staticmethod
    def of(config: GridConfig) -> Grid:
        """The grid of a cell config."""
        x, y, z = config.origin_m
        nx, ny, nz = config.shape
        return Grid((x, y, z), (nx, ny, nz), config.resolution_m)

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return self.shape[0] * self.shape[1] * self.shape[2]

    @property
    def fingerprint(self) -> str:
        """16 hex digits that change with origin, shape or resolution."""
        text = f"{self.origin_m!r} {self.shape!r} {self.resolution_m!r}"
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def centres(self, cells: NDArray[Any]) -> F64:
        """(C, 3) centres in metres of flat indices (C,)."""
        ijk = np.stack(np.unravel_index(np.asarray(cells, dtype=np.int64), self.shape), axis=-1)
        return np.asarray(np.asarray(self.origin_m) + (ijk + 0.5) * self.resolution_m, dtype=np.float64)

    def cells_of(self, points_m: F64) -> I32:
        """Flat indices (P,) of points (P, 3); -1 outside the grid."""
        ijk = np.floor((np.asarray(points_m, dtype=np.float64) - np.asarray(self.origin_m)) / self.resolution_m).astype(np.int64)
        inside = np.all((ijk >= 0) & (ijk < np.asarray(self.shape)), axis=-1)
        flat = (ijk[..., 0] * self.shape[1] + ijk[..., 1]) * self.shape[2] + ijk[..., 2]
        return np.where(inside, flat, -1).astype(np.int32)
