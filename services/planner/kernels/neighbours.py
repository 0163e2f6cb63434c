"""Cells among their neighbours. Twin: ``tests/support/slow_neighbours.py``."""

from __future__ import annotations

import numpy as np

from common.kernel import leaf

__all__ = ["in_patches"]


@leaf
def in_patches(cells, shape, least, marked, keep):  # type: ignore[no-untyped-def]
    """Set ``keep`` (C,) where ``least`` of ``cells``, the cell itself included, lie within its 3 x 3 x 3 cells.

    Args:
        cells: (C,) int32 flat indices.
        shape: cells along x, y, z.
        least: how many.
        marked: (n_cells,) uint8 scratch, all zero before and after.
        keep: (C,) bool out.
    """
    nx, ny, nz = shape
    marked[cells] = 1
    for i in range(len(cells)):
        z = cells[i] % nz
        y = (cells[i] // nz) % ny
        x = cells[i] // (nz * ny)
        count = 0
        for u in range(max(x - 1, 0), min(x + 2, nx)):
            for v in range(max(y - 1, 0), min(y + 2, ny)):
                for w in range(max(z - 1, 0), min(z + 2, nz)):
                    count += marked[(u * ny + v) * nz + w]
        keep[i] = count >= least
    for i in range(len(cells)):
        marked[cells[i]] = np.uint8(0)
