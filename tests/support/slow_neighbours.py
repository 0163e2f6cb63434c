"""The slow, obvious twin of ``services/planner/kernels/neighbours.py``."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def in_patches(cells: NDArray[np.int32], shape: tuple[int, int, int], least: int) -> NDArray[np.bool_]:
    """Cells (C,) that have ``least`` of ``cells``, themselves included, at most one cell away along each axis."""
    place = np.stack(np.unravel_index(cells, shape), axis=-1).reshape(-1, 3)
    return np.array([np.sum(np.abs(place - here).max(axis=1) <= 1) >= least for here in place], dtype=bool)
