"""Numba kernels of the evidence: hits occupy at once, misses clear in time, hidden cells keep.

Twin: ``tests/support/slow_perception.py``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from common.kernel import leaf
from services.perception.core.look_kernels import OUT_OF_VIEW, PROBABLY_FREE, SEEN_THROUGH
from services.perception.core.splat_kernels import cell_of, centre_of

__all__ = ["Evidence", "age", "centres_with_bound", "new_evidence", "settle", "shadow_candidates"]


class Evidence(NamedTuple):
    """What is believed of each cell between sets."""

    occupied: NDArray[np.uint8]  # (cells,)
    misses: NDArray[np.uint8]  # (cells,) weighted misses since the last hit
    cameras: NDArray[np.uint8]  # (cells,) bits of the cameras that gave the last hit
    touched_set: NDArray[np.int64]  # (cells,) number of the last set with a point in the cell
    in_view_s: NDArray[np.float64]  # (cells,) when it was last hit or within a view
    active: NDArray[np.int32]  # (cells,) the first ``n`` are the occupied cells, in no order


def new_evidence(n_cells: int) -> Evidence:
    """Nothing seen yet."""
    return Evidence(
        np.zeros(n_cells, np.uint8),
        np.zeros(n_cells, np.uint8),
        np.zeros(n_cells, np.uint8),
        np.full(n_cells, -1, np.int64),
        np.zeros(n_cells),
        np.zeros(n_cells, np.int32),
    )


@leaf
def settle(counts, n_touched, min_points, set_number, now_s, evidence, n_active):  # type: ignore[no-untyped-def]
    """Turn the counts of a set into hits and empty them; returns the number of occupied cells.

    Fewer points than ``min_points`` are no hit, but they are no sign of emptiness either: such a cell is not aged in this set.
    """
    points, cameras, touched = counts.points, counts.cameras, counts.touched
    occupied, active, misses, seen_by, touched_set, in_view_s = (
        evidence.occupied,
        evidence.active,
        evidence.misses,
        evidence.cameras,
        evidence.touched_set,
        evidence.in_view_s,
    )
    for i in range(n_touched):
        cell = touched[i]
        if points[cell] >= min_points:
            if occupied[cell] == 0:
                occupied[cell] = 1
                active[n_active] = cell
                n_active += 1
            misses[cell] = 0
            seen_by[cell] = cameras[cell]
            in_view_s[cell] = now_s
        touched_set[cell] = set_number
        points[cell] = 0
        cameras[cell] = 0
    return n_active


@leaf
def centres_with_bound(frame, cells, n_cells, bound_m, points_m):  # type: ignore[no-untyped-def]
    """Write centre and ``bound_m`` of ``cells[i]``, i < n_cells, to ``points_m`` (N, 4), as the self-filter's kernel wants them."""
    for i in range(n_cells):
        points_m[i, 0], points_m[i, 1], points_m[i, 2] = centre_of(frame, cells[i])
        points_m[i, 3] = bound_m


@leaf
def age(evidence, n_active, set_number, now_s, verdict, inside, weights, decay_s):  # type: ignore[no-untyped-def]
    """Count the misses of this set and drop what was cleared; returns the number of occupied cells left.

    Args:
        evidence: in and out.
        n_active: occupied cells before.
        set_number: this set; cells touched in it are left alone.
        now_s: time of the set.
        verdict: (N,) of :func:`look_at_cells` for ``evidence.active``.
        inside: (N,) 1 where the arm itself is: nothing else can be there.
        weights: (strong miss, weak miss, clear at).
        decay_s: how long a cell stays that no camera has in view.
    """
    kept = 0
    for i in range(n_active):
        cell = evidence.active[i]
        if evidence.touched_set[cell] != set_number:
            misses = int(evidence.misses[cell])
            if verdict[i] != OUT_OF_VIEW:
                evidence.in_view_s[cell] = now_s
            if verdict[i] == SEEN_THROUGH or inside[i]:
                misses += weights[0]
            elif verdict[i] == PROBABLY_FREE:
                misses += weights[1]
            evidence.misses[cell] = min(misses, 255)
            if misses >= weights[2] or now_s - evidence.in_view_s[cell] > decay_s:
                evidence.occupied[cell] = 0
                evidence.misses[cell] = 0
                continue
        evidence.active[kept] = cell
        kept += 1
    return kept


@leaf
def shadow_candidates(frame, evidence, n_active, camera_m, n_cameras, depth_m, set_number, visited, out):  # type: ignore[no-untyped-def]
    """Cells less than ``depth_m`` behind an occupied one, seen from a camera that gave its last hit.

    Args:
        frame: the grid.
        evidence: of all cells.
        n_active: occupied cells.
        camera_m: (cameras, 3) where the cameras are; row i belongs to bit i.
        n_cameras: rows that are valid.
        depth_m: length of the shadow.
        set_number: this set.
        visited: (cells,) i8 set in which a cell was last a candidate, in and out.
        out: (cells,) i4.

    Returns:
        the number of candidates in ``out``.
    """
    occupied, active, seen_by = evidence.occupied, evidence.active, evidence.cameras
    n_out = 0
    step = frame.resolution_m * 0.5
    n_steps = int(depth_m / step + 0.5)
    for i in range(n_active):
        cell = active[i]
        x, y, z = centre_of(frame, cell)
        for camera in range(n_cameras):
            if not seen_by[cell] & (1 << camera):
                continue
            dx, dy, dz = x - camera_m[camera, 0], y - camera_m[camera, 1], z - camera_m[camera, 2]
            scale = step / max((dx * dx + dy * dy + dz * dz) ** 0.5, 1e-9)
            for s in range(1, n_steps + 1):
                behind = cell_of(frame, x + dx * scale * s, y + dy * scale * s, z + dz * scale * s)
                if behind < 0:
                    break
                if occupied[behind] == 0 and visited[behind] != set_number:
                    visited[behind] = set_number
                    out[n_out] = behind
                    n_out += 1
    return n_out
