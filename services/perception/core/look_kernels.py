"""Numba kernels that ask the depth images about cells: seen through, or not? Twin: ``tests/support/slow_perception.py``.

A cell is projected, and what was measured along the ray through its centre is compared with where it lies. So free space needs no
background far behind it, only a ray that goes on:

* SEEN_THROUGH: the measured surface is behind the whole cell and its noise, or it is known background behind the cell's centre.
* PROBABLY_FREE: the surface is behind the cell but within its noise, or the arm stands behind the cell's centre, or nothing came back at
  all. A thing that stands in view does return something most of the time, so missing returns count, but little; a single lost pixel
  does not count, its neighbours do.
* NO_EVIDENCE: the surface is in the cell or before it (hidden by the arm or by a thing).
* OUT_OF_VIEW: beside the image, or nearer than the sensor can see.
"""

from __future__ import annotations

import math

from common.kernel import leaf
from services.perception.core.background_kernels import is_solid, is_table
from services.perception.core.splat_kernels import cell_of, centre_of

__all__ = ["NO_EVIDENCE", "OUT_OF_VIEW", "PROBABLY_FREE", "SEEN_THROUGH", "look_at_cells"]

OUT_OF_VIEW, NO_EVIDENCE, PROBABLY_FREE, SEEN_THROUGH = 0, 1, 2, 3
HALF_DIAGONAL = math.sqrt(3.0) / 2.0


@leaf
def _depth_around(depth_mm, v, u):  # type: ignore[no-untyped-def]
    """The pixel's depth in metres; where it gave no return the nearest of its eight neighbours; 0 when none returned anything."""
    if depth_mm[v, u] > 0:
        return depth_mm[v, u] * 0.001
    height, width = depth_mm.shape
    nearest = 0
    for row in range(max(0, v - 1), min(height, v + 2)):
        for column in range(max(0, u - 1), min(width, u + 2)):
            d = depth_mm[row, column]
            if d > 0 and (nearest == 0 or d < nearest):
                nearest = d
    return nearest * 0.001


@leaf
def _surface_at(optics, R, t, depth, u, v):  # type: ignore[no-untyped-def]
    """World point of pixel (u, v) at a depth."""
    a, b = (u - optics.cx_px) / optics.fx_px * depth, (v - optics.cy_px) / optics.fy_px * depth
    return (
        R[0, 0] * a + R[0, 1] * b + R[0, 2] * depth + t[0],
        R[1, 0] * a + R[1, 1] * b + R[1, 2] * depth + t[1],
        R[2, 0] * a + R[2, 1] * b + R[2, 2] * depth + t[2],
    )


@leaf
def look_at_cells(frame, cells, n_cells, view, background, arm_sigmas, verdict, asked, asked_m):  # type: ignore[no-untyped-def]
    """Raise ``verdict[i]`` to what this exposure says about ``cells[i]``, i < n_cells: the strongest of all exposures remains.

    Args:
        frame: the grid.
        cells: (N,) i4 flat indices.
        n_cells: how many of them.
        view, background: the exposure and what is bolted down.
        arm_sigmas: range noise bound of the self-filter, in sigma(z).
        verdict: (N,) u1, in and out; begin with OUT_OF_VIEW.
        asked: (N,) i4 out: which i are PROBABLY_FREE if the surface behind them is the arm's.
        asked_m: (N, 4) out: those surface points and their bound, for :func:`services.perception.core.arm_kernels.arm_mask`.

    Returns:
        how many were asked.
    """
    optics, R, t, depth_mm = view.optics, view.rotation, view.translation, view.depth_mm
    rules, solids, near = background.rules, background.solids, background.near
    height, width = depth_mm.shape
    half = frame.resolution_m * HALF_DIAGONAL
    n_asked = 0
    for i in range(n_cells):
        x, y, z = centre_of(frame, cells[i])
        a, b, c = x - t[0], y - t[1], z - t[2]
        depth = R[0, 2] * a + R[1, 2] * b + R[2, 2] * c
        if depth < optics.min_range_m:
            continue
        u = math.floor((R[0, 0] * a + R[1, 0] * b + R[2, 0] * c) / depth * optics.fx_px + optics.cx_px + 0.5)
        v = math.floor((R[0, 1] * a + R[1, 1] * b + R[2, 1] * c) / depth * optics.fy_px + optics.cy_px + 0.5)
        if not (0 <= u < width and 0 <= v < height):
            continue
        measured = _depth_around(depth_mm, v, u)
        gap = measured - depth
        sigma = optics.sigma_per_m2 * measured * measured
        seen = NO_EVIDENCE
        if measured == 0.0:
            seen = PROBABLY_FREE
        elif gap > half + rules.sigmas * sigma:
            seen = SEEN_THROUGH
        elif gap > 0.0:
            px, py, pz = _surface_at(optics, R, t, measured, u, v)
            cell = cell_of(frame, px, py, pz)
            if is_table(rules, pz, measured, sigma, t[2]) or (cell >= 0 and is_solid(rules, solids, near, cell, px, py, pz, sigma)):
                seen = SEEN_THROUGH
            elif gap > half:
                seen = PROBABLY_FREE
            else:
                asked[n_asked] = i
                asked_m[n_asked, 0], asked_m[n_asked, 1], asked_m[n_asked, 2], asked_m[n_asked, 3] = px, py, pz, arm_sigmas * sigma
                n_asked += 1
        verdict[i] = max(verdict[i], seen)
    return n_asked
