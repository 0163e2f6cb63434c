"""Building and reading the lookup table: which cells a pose sweeps, which neurons and edges a cell blocks.

The rule that ties a cell to a pose is :func:`services.planner.kernels.body_cells.cell_touches_body`, the same that checks paths. Twin:
``tests/support/slow_planner.py`` (every cell of the grid against every body).
"""

from __future__ import annotations

import math

import numpy as np

from common.kernel import kernel, leaf
from common.robot.kernels import body_grid, forward_kinematics
from services.planner.kernels.body_cells import ROOT3, cell_touches_body
from services.planner.kernels.moves import segment_steps
from services.planner.kernels.prefetch import AHEAD, fetch_row, prefetch

__all__ = ["PAGE", "count_rows", "edge_extra_cells", "exposed_cells", "node_cells", "pose_cells", "take_cells"]

PAGE = 1 << 16  # owners of a page of rows: as many as 16 bits tell apart


@leaf
def pose_cells(arm, origin_m, shape, cell_m, safety_m, rotation, translation, stamp, mark, out, n_out):  # type: ignore[no-untyped-def]
    """Append the flat indices of all cells that block a pose to ``out`` from ``n_out`` on; returns the new count.

    Cells whose ``stamp`` (n_cells,) already equals ``mark`` are left out, the others are stamped: so the caller dedupes over bodies and
    over poses. Returns -1 if ``out`` is too short. For each body only the columns and heights of cells that its inflated box reaches are
    looked at.

    Args:
        arm: :class:`~services.planner.kernels.collision.Arm`.
        origin_m, shape, cell_m: the grid.
        safety_m: inflation.
        rotation, translation: frames of the pose.
    """
    grids = arm.grids
    distance = grids.distance
    half_m = cell_m / 2.0
    reach = safety_m + half_m * ROOT3
    for b in range(len(arm.moving)):
        if not arm.moving[b]:
            continue
        j = grids.body_joint[b]
        turn, shift, grid = rotation[j], translation[j], body_grid(grids, b)
        low0, high0 = grids.box_min_m[b, 0] - reach, grids.box_max_m[b, 0] + reach
        low1, high1 = grids.box_min_m[b, 1] - reach, grids.box_max_m[b, 1] + reach
        low2, high2 = grids.box_min_m[b, 2] - reach, grids.box_max_m[b, 2] + reach
        centre0, centre1, centre2 = (low0 + high0) / 2.0, (low1 + high1) / 2.0, (low2 + high2) / 2.0
        half0, half1, half2 = (high0 - low0) / 2.0, (high1 - low1) / 2.0, (high2 - low2) / 2.0
        # World box of the turned, inflated box.
        wx = shift[0] + turn[0, 0] * centre0 + turn[0, 1] * centre1 + turn[0, 2] * centre2
        wy = shift[1] + turn[1, 0] * centre0 + turn[1, 1] * centre1 + turn[1, 2] * centre2
        ex = abs(turn[0, 0]) * half0 + abs(turn[0, 1]) * half1 + abs(turn[0, 2]) * half2
        ey = abs(turn[1, 0]) * half0 + abs(turn[1, 1]) * half1 + abs(turn[1, 2]) * half2
        x_first = max(0, math.floor((wx - ex - origin_m[0]) / cell_m - 0.5))
        x_last = min(shape[0] - 1, math.ceil((wx + ex - origin_m[0]) / cell_m - 0.5))
        y_first = max(0, math.floor((wy - ey - origin_m[1]) / cell_m - 0.5))
        y_last = min(shape[1] - 1, math.ceil((wy + ey - origin_m[1]) / cell_m - 0.5))
        d0, d1, d2 = turn[2, 0], turn[2, 1], turn[2, 2]  # world z in the body's frame
        for ix in range(x_first, x_last + 1):
            px = origin_m[0] + (ix + 0.5) * cell_m - shift[0]
            for iy in range(y_first, y_last + 1):
                py = origin_m[1] + (iy + 0.5) * cell_m - shift[1]
                # The column is the line a + z d in the body's frame (z from the body's origin): clip it by the box's slabs.
                a0 = turn[0, 0] * px + turn[1, 0] * py
                a1 = turn[0, 1] * px + turn[1, 1] * py
                a2 = turn[0, 2] * px + turn[1, 2] * py
                z_low, z_high = origin_m[2] - shift[2], origin_m[2] + shape[2] * cell_m - shift[2]
                z_low, z_high = _clip(a0, d0, low0, high0, z_low, z_high)
                z_low, z_high = _clip(a1, d1, low1, high1, z_low, z_high)
                z_low, z_high = _clip(a2, d2, low2, high2, z_low, z_high)
                if z_low > z_high:
                    continue
                z_first = max(0, math.floor((z_low + shift[2] - origin_m[2]) / cell_m - 0.5))
                z_last = min(shape[2] - 1, math.ceil((z_high + shift[2] - origin_m[2]) / cell_m - 0.5))
                base = (ix * shape[1] + iy) * shape[2]
                for iz in range(z_first, z_last + 1):
                    if stamp[base + iz] == mark:
                        continue
                    pz = origin_m[2] + (iz + 0.5) * cell_m - shift[2]
                    if cell_touches_body(distance, grid, turn, a0 + pz * d0, a1 + pz * d1, a2 + pz * d2, half_m, safety_m):
                        if n_out >= len(out):
                            return -1
                        stamp[base + iz] = mark
                        out[n_out] = base + iz
                        n_out += 1
    return n_out


@leaf
def _clip(a, d, low, high, z_low, z_high):  # type: ignore[no-untyped-def]
    """The part of ``z_low..z_high`` in which ``low <= a + z d <= high``; empty (low above high) if there is none."""
    if abs(d) < 1e-9:
        if a < low or a > high:
            return 1.0, 0.0
        return z_low, z_high
    u, v = (low - a) / d, (high - a) / d
    if u > v:
        u, v = v, u
    return max(z_low, u), min(z_high, v)


@kernel
def node_cells(arm, origin_m, shape, cell_m, safety_m, q_rad, first, stamp, out, offset):  # type: ignore[no-untyped-def]
    """Cells of the neurons ``q_rad`` (n, J) one after another into ``out``; row k ends at ``offset[k + 1]``, ``offset[0]`` is 0.

    Returns the number of neurons done: fewer than n when ``out`` was full (call again with the rest). ``first`` makes the stamps unique.
    """
    n_joints = q_rad.shape[1]
    rotation, translation = np.empty((n_joints + 1, 3, 3)), np.empty((n_joints + 1, 3))
    n_out = 0
    for k in range(len(q_rad)):
        forward_kinematics(arm.chain, q_rad[k], rotation, translation)
        n = pose_cells(arm, origin_m, shape, cell_m, safety_m, rotation, translation, stamp, first + k, out, n_out)
        if n < 0:
            return k
        out[n_out:n].sort()
        n_out = n
        offset[k + 1] = n_out
    return len(q_rad)


@kernel
def edge_extra_cells(  # type: ignore[no-untyped-def]
    arm, origin_m, shape, cell_m, safety_m, step_m, q_rad, edges, node_offset, node_cell, first, stamp, out, offset
):
    """Cells that an edge sweeps beyond those of its two ends, for ``edges`` (m, 2), as :func:`node_cells` gives them for neurons.

    The straight joint segment is sampled so that no point of the arm moves by more than ``step_m`` between samples.
    """
    n_joints = q_rad.shape[1]
    rotation, translation = np.empty((2, n_joints + 1, 3, 3)), np.empty((2, n_joints + 1, 3))
    dq, q = q_rad[0].copy(), q_rad[0].copy()
    n_out = 0
    for k in range(len(edges)):
        a, b = edges[k, 0], edges[k, 1]
        mark = first + k
        for end in (a, b):
            for i in range(node_offset[end], node_offset[end + 1]):
                stamp[node_cell[i]] = mark
        for j in range(n_joints):
            dq[j] = q_rad[b, j] - q_rad[a, j]
        n_steps = segment_steps(arm, q_rad[a], dq, step_m, rotation, translation)
        n = n_out
        for s in range(1, n_steps):
            for j in range(n_joints):
                q[j] = q_rad[a, j] + dq[j] * (s / n_steps)
            forward_kinematics(arm.chain, q, rotation[0], translation[0])
            n = pose_cells(arm, origin_m, shape, cell_m, safety_m, rotation[0], translation[0], stamp, mark, out, n)
            if n < 0:
                return k
        out[n_out:n].sort()
        n_out = n
        offset[k + 1] = n_out
    return len(edges)


@leaf
def count_rows(items, row_count):  # type: ignore[no-untyped-def]
    """Add to ``row_count`` (n_cells,) how often each cell occurs in ``items``."""
    for i in range(len(items)):
        row_count[items[i]] += 1


@kernel
def take_cells(before, counted_before, cells, never, shape, occupied, node_rows, edge_rows):  # type: ignore[no-untyped-def]
    """Take in that ``cells`` (C,) are occupied now, ``before`` (B,) were before; all ascending. Cost follows the difference.

    Args:
        counted_before: what was counted of ``before``.
        never, shape, occupied: as for :func:`exposed_cells`; ``occupied`` of length 0: enclosed cells are counted, too.
        node_rows, edge_rows: offsets (pages, n_cells + 1) and owners of the table's rows, and the owners' counts, which are changed.

    Returns:
        (appeared, gone, counted of ``cells``, what appeared among the counted, what is gone of them), int32 ascending.
    """
    appeared, gone = _difference(before, cells)
    counted = np.empty(len(cells), dtype=np.int32)
    if len(occupied) == 0:
        counted[:] = cells
    else:
        counted = counted[: exposed_cells(cells, appeared, gone, never, shape, occupied, counted)]
    more, less = _difference(counted_before, counted)
    for offset, owner, count in (node_rows, edge_rows):
        _add_to_counts(more, 1, offset, owner, count)
        _add_to_counts(less, -1, offset, owner, count)
    return appeared, gone, counted, more, less


@kernel
def _difference(before, after):  # type: ignore[no-untyped-def]
    appeared, gone = np.empty(len(after), dtype=np.int32), np.empty(len(before), dtype=np.int32)
    n_appeared, n_gone = _split(before, after, appeared, gone)
    return appeared[:n_appeared], gone[:n_gone]


@leaf
def _split(before, after, appeared, gone):  # type: ignore[no-untyped-def]
    """What ``after`` has and ``before`` has not into ``appeared``, and the reverse into ``gone``, all ascending; how many of each."""
    i, k, n_appeared, n_gone = 0, 0, 0, 0
    while i < len(before) or k < len(after):
        if k == len(after) or (i < len(before) and before[i] < after[k]):
            gone[n_gone] = before[i]
            i, n_gone = i + 1, n_gone + 1
        elif i == len(before) or after[k] < before[i]:
            appeared[n_appeared] = after[k]
            k, n_appeared = k + 1, n_appeared + 1
        else:
            i, k = i + 1, k + 1
    return n_appeared, n_gone


@leaf
def exposed_cells(cells, appeared, gone, never, shape, occupied, out):  # type: ignore[no-untyped-def]
    """Those of ``cells`` (C,) that are not enclosed: one of the 26 cells around is empty or outside of the grid.

    Args:
        cells: flat indices, ascending, of all that is occupied.
        appeared, gone: how they differ from the last call's, ascending.
        never: flat indices, ascending, of cells that count as empty whatever they are.
        shape: (3,) of the grid.
        occupied: the grid with a rim of empty cells, flat, uint8; kept from call to call.
        out: (C,) the answer, ascending. Returns how many there are.
    """
    side_z, side_yz = shape[2] + 2, (shape[1] + 2) * (shape[2] + 2)
    for changed, state in ((gone, 0), (appeared, 1), (never, 0)):
        row_end, shift = -1, 0
        for cell in changed:
            if cell >= row_end:
                row_end, shift = _row_in_rim(cell, shape, side_z, side_yz)
            occupied[cell + shift] = state
    n_out, row_end, shift = 0, -1, 0
    for cell in cells:
        if cell >= row_end:
            row_end, shift = _row_in_rim(cell, shape, side_z, side_yz)
        at = cell + shift
        enclosed = occupied[at - 1] & occupied[at + 1] & occupied[at - side_z] & occupied[at + side_z]  # most cells show here already
        if enclosed:
            for dx in (-side_yz, 0, side_yz):
                for dy in (-side_z, 0, side_z):
                    enclosed &= occupied[at + dx + dy - 1] & occupied[at + dx + dy] & occupied[at + dx + dy + 1]
        if not enclosed:
            out[n_out] = cell
            n_out += 1
    return n_out


@leaf
def _row_in_rim(cell, shape, side_z, side_yz):  # type: ignore[no-untyped-def]
    """Where the row of cells along z ends that ``cell`` is in, and how much larger its indices are in the grid that has a rim."""
    row = cell // shape[2]
    return (row + 1) * shape[2], (row // shape[1] + 1) * side_yz + (row % shape[1] + 1) * side_z + 1 - row * shape[2]


@leaf
def _add_to_counts(cells, sign, row_offset, row_owner, count):  # type: ignore[no-untyped-def]
    """Add ``sign`` to ``count`` of every owner in the rows of ``cells`` (C,). Cost follows the changed cells."""
    n = len(cells)
    for page in range(len(row_offset)):
        offset, mine = row_offset[page], count[page * PAGE :]
        for c in range(n):
            if c + 2 * AHEAD < n:
                prefetch(offset, np.int64(cells[c + 2 * AHEAD]))
            if c + AHEAD < n:
                fetch_row(offset, row_owner, cells[c + AHEAD], cells[c + AHEAD] + 1)
            for owner in row_owner[offset[cells[c]] : offset[cells[c] + 1]]:
                mine[np.uint64(owner)] += sign  # unsigned, or each would be looked at whether it counts from the end: a third slower
