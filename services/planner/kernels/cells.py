"""Occupied cells as the checks see them: neighbours together, so that most are ruled out sixteen at a time, or sixteen times sixteen."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from common.kernel import kernel, leaf

__all__ = ["BLOCK", "GROUP", "Cells", "arrange_cells"]

F64 = NDArray[np.float64]

BLOCK = 16  # cells that share a bounding sphere; our choice
GROUP = 16  # blocks that share one


class Cells(NamedTuple):
    """Occupied cells in Morton order, with a bounding sphere for every ``BLOCK`` of them and for every ``GROUP`` of blocks."""

    flat: NDArray[np.int32]  # (C,) indices in the grid
    centre_m: F64  # (C, 3)
    block_m: F64  # (ceil(C / BLOCK), 4) centre and radius that contain the blocks' centres
    group_m: F64  # (ceil(C / BLOCK / GROUP), 4) centre and radius that contain the same centres, of GROUP blocks
    half_m: float  # half the edge of a cell


@leaf
def _spread(n):  # type: ignore[no-untyped-def]
    """The low 16 bits of ``n``, two zero bits after each."""
    n = (n | (n << 16)) & 0x0000FF0000FF
    n = (n | (n << 8)) & 0x00F00F00F00F
    n = (n | (n << 4)) & 0x0C30C30C30C3
    return (n | (n << 2)) & 0x249249249249


@leaf
def _gather(n):  # type: ignore[no-untyped-def]
    """What :func:`_spread` spread; bits between are ignored."""
    n &= 0x249249249249
    n = (n | (n >> 2)) & 0x0C30C30C30C3
    n = (n | (n >> 4)) & 0x00F00F00F00F
    n = (n | (n >> 8)) & 0x0000FF0000FF
    return (n | (n >> 16)) & 0xFFFF


@kernel
def arrange_cells(cells, origin_m, shape, resolution_m):  # type: ignore[no-untyped-def]
    """``flat``, ``centre_m``, ``block_m`` and ``group_m`` of :class:`Cells` from flat indices ``cells`` (C,) in any order.

    ``origin_m`` and ``shape``: three numbers each, of the grid.
    """
    n, ny, nz = len(cells), shape[1], shape[2]
    code, flat, centre_m = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int32), np.empty((n, 3))
    row_begin, row_code = nz * ny * shape[0], 0
    for i in range(n):
        if not row_begin <= cells[i] < row_begin + nz:  # cells mostly come row by row
            row = cells[i] // nz
            row_begin, row_code = row * nz, (_spread(row // ny) << 2) | (_spread(row % ny) << 1)
        code[i] = row_code | _spread(cells[i] - row_begin)
    code.sort()
    for i in range(n):
        x, y, z = _gather(code[i] >> 2), _gather(code[i] >> 1), _gather(code[i])
        flat[i] = (x * ny + y) * nz + z
        centre_m[i, 0] = origin_m[0] + (x + 0.5) * resolution_m
        centre_m[i, 1] = origin_m[1] + (y + 0.5) * resolution_m
        centre_m[i, 2] = origin_m[2] + (z + 0.5) * resolution_m
    n_blocks = (n + BLOCK - 1) // BLOCK
    block_m, group_m = np.empty((n_blocks, 4)), np.empty(((n_blocks + GROUP - 1) // GROUP, 4))
    _bound_runs(centre_m, BLOCK, block_m)
    _bound_runs(centre_m, BLOCK * GROUP, group_m)
    return flat, centre_m, block_m, group_m


@leaf
def _bound_runs(centre_m, run, bound_m):  # type: ignore[no-untyped-def]
    """Fill ``bound_m`` (n, 4) with bounding spheres of each ``run`` rows of ``centre_m`` (C, 3)."""
    for k in range(len(bound_m)):
        first, last = k * run, min((k + 1) * run, len(centre_m))
        for axis in range(3):
            low, high = centre_m[first, axis], centre_m[first, axis]
            for i in range(first + 1, last):
                low, high = min(low, centre_m[i, axis]), max(high, centre_m[i, axis])
            bound_m[k, axis] = (low + high) / 2.0
        radius2 = 0.0
        for i in range(first, last):
            d2 = 0.0
            for axis in range(3):
                d2 += (centre_m[i, axis] - bound_m[k, axis]) ** 2
            radius2 = max(radius2, d2)
        bound_m[k, 3] = math.sqrt(radius2)
