"""Numba kernels that drop points into cells: what is background or arm falls away, the rest is counted. Twin: ``slow_perception.py``."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from common.geometry.grid import Grid
from common.kernel import leaf
from services.perception.core.background_kernels import is_solid, is_table

__all__ = ["Counts", "GridFrame", "cell_of", "centre_of", "count", "foreground", "frame_of", "new_counts"]


class GridFrame(NamedTuple):
    """The grid as plain numbers."""

    x0: float
    y0: float
    z0: float
    resolution_m: float
    nx: int
    ny: int
    nz: int


class Counts(NamedTuple):
    """Points a cell in one set of exposures; all zero again after :func:`services.perception.core.evidence_kernels.settle`."""

    points: NDArray[np.uint16]  # (cells,)
    cameras: NDArray[np.uint8]  # (cells,) bits of the cameras that gave them
    touched: NDArray[np.int32]  # (cells,) the first ``n`` are the cells with points


def frame_of(grid: Grid) -> GridFrame:
    """The numbers of a grid."""
    (x0, y0, z0), (nx, ny, nz) = grid.origin_m, grid.shape
    return GridFrame(float(x0), float(y0), float(z0), float(grid.resolution_m), nx, ny, nz)


def new_counts(n_cells: int) -> Counts:
    """Empty counts."""
    return Counts(np.zeros(n_cells, np.uint16), np.zeros(n_cells, np.uint8), np.zeros(n_cells, np.int32))


@leaf
def centre_of(frame, cell):  # type: ignore[no-untyped-def]
    """World centre x, y, z of a cell."""
    return (
        frame.x0 + (cell // (frame.ny * frame.nz) + 0.5) * frame.resolution_m,
        frame.y0 + (cell // frame.nz % frame.ny + 0.5) * frame.resolution_m,
        frame.z0 + (cell % frame.nz + 0.5) * frame.resolution_m,
    )


@leaf
def cell_of(frame, x, y, z):  # type: ignore[no-untyped-def]
    """Flat index of the cell of a world point, -1 outside the grid."""
    inverse = 1.0 / frame.resolution_m
    fx, fy, fz = (x - frame.x0) * inverse, (y - frame.y0) * inverse, (z - frame.z0) * inverse
    if not (0.0 <= fx < frame.nx and 0.0 <= fy < frame.ny and 0.0 <= fz < frame.nz):
        return -1
    return (int(fx) * frame.ny + int(fy)) * frame.nz + int(fz)


@leaf
def foreground(frame, points_m, view, background, sigmas, kept_m, kept_cell):  # type: ignore[no-untyped-def]
    """Pick the points of one exposure that lie in the grid and are not background; returns how many.

    Args:
        frame: the grid.
        points_m: (P, 3) f4 world points.
        view: the :class:`CameraView` they come from.
        background: table and solids.
        sigmas: range noise bound of the self-filter, in sigma(z).
        kept_m: (>= P, 4) out: x, y, z and that bound in metres.
        kept_cell: (>= P,) i4 out: flat index of the point's cell.
    """
    optics, R, t = view.optics, view.rotation, view.translation
    rules, solids, near = background.rules, background.solids, background.near
    n = 0
    for i in range(len(points_m)):
        x, y, z = float(points_m[i, 0]), float(points_m[i, 1]), float(points_m[i, 2])
        depth = R[0, 2] * (x - t[0]) + R[1, 2] * (y - t[1]) + R[2, 2] * (z - t[2])
        sigma = optics.sigma_per_m2 * depth * depth
        # The table first: its points lie on both sides of the grid's floor, and a branch nobody can predict costs more than this test.
        if is_table(rules, z, depth, sigma, t[2]):
            continue
        cell = cell_of(frame, x, y, z)
        if cell < 0 or is_solid(rules, solids, near, cell, x, y, z, sigma):
            continue
        kept_m[n, 0], kept_m[n, 1], kept_m[n, 2], kept_m[n, 3] = x, y, z, sigmas * sigma
        kept_cell[n] = cell
        n += 1
    return n


@leaf
def count(cells, is_arm, n_points, bit, counts, n_touched):  # type: ignore[no-untyped-def]
    """Count the points (N,) that are not the arm in their cells; returns cells touched so far in the set and points that were the arm."""
    points, cameras, touched = counts.points, counts.cameras, counts.touched
    n_arm = 0
    for i in range(n_points):
        if is_arm[i]:
            n_arm += 1
            continue
        cell = cells[i]
        if points[cell] == 0:
            touched[n_touched] = cell
            n_touched += 1
        points[cell] = min(points[cell] + 1, 65535)
        cameras[cell] |= bit
    return n_touched, n_arm
