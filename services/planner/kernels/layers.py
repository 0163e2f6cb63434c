"""Layers of clearance: in which band of distance of a block of cells a pose, a neuron, an edge lies.

Band k of an owner holds the blocks that are within ``within_m[k]`` of it and not within ``within_m[k - 1]``. A band's entry is the number
``block * n_bands + band``, so that a table of them is one of cells like any other. Twin: ``tests/support/slow_layers.py``.
"""

from __future__ import annotations

import math

import numpy as np

from common.kernel import kernel, leaf
from common.robot.kernels import forward_kinematics
from services.planner.kernels.body_cells import ROOT3, octant_middle
from services.planner.kernels.moves import segment_steps
from services.planner.kernels.reach import look_far, reach_grid

__all__ = ["edge_bands", "node_bands"]


@leaf
def _band(distance, grid, turn, u, v, w, half_m, within_m, n_below):  # type: ignore[no-untyped-def]
    """The smallest band below ``n_below`` in which the cube around a point lies as seen from a body; ``n_below`` if none.

    The rule of :func:`services.planner.kernels.body_cells.cell_touches_body` for each layer: the cube's ball, else its eight octants.
    ``u, v, w``: the point in the body's frame, whose rotation is ``turn``.
    """
    centre = look_far(distance, grid, u, v, w)
    if centre > within_m[n_below - 1] + half_m * ROOT3:
        return n_below
    octants = np.inf
    quarter = 0.5 * half_m
    for k in range(n_below):
        if centre <= within_m[k] + half_m:
            return k
        if centre > within_m[k] + half_m * ROOT3:
            continue
        if octants == np.inf:
            for octant in range(8):
                x, y, z = octant_middle(turn, u, v, w, quarter, octant)
                octants = min(octants, look_far(distance, grid, x, y, z))
        if octants <= within_m[k] + quarter * ROOT3:
            return k
    return n_below


@leaf
def _pose_bands(arm, reach, blocks, within_m, rotation, translation, mark, seen, listed, out, n_out):  # type: ignore[no-untyped-def]
    """Lower the bands of all blocks by what a pose is near; append blocks that this lowers for the first time to ``out``.

    Returns the new count, -1 if ``out`` is too short.

    Args:
        blocks: (origin (3,), shape (3,), edge in metres) of the blocks.
        within_m: (L,) ascending.
        rotation, translation: frames of the pose.
        mark: number of the owner. ``seen[block] - mark * (L + 1)`` is the block's band where that is 0..L - 1; ``listed[block] == mark``
            says that it is in ``out``. Both (n_blocks,).
    """
    origin_m, shape, block_m = blocks
    n_bands = len(within_m)
    base_mark = mark * (n_bands + 1)
    half_m = block_m / 2.0
    room = within_m[n_bands - 1] + half_m * ROOT3
    grids, distance = arm.grids, reach.distance
    for b in range(len(arm.moving)):
        if not arm.moving[b]:
            continue
        turn, shift, grid = rotation[grids.body_joint[b]], translation[grids.body_joint[b]], reach_grid(reach, b)
        box = grids, b, turn, shift, room, origin_m, shape, block_m
        x_first, x_last = _blocks_along(box, 0)
        y_first, y_last = _blocks_along(box, 1)
        z_first, z_last = _blocks_along(box, 2)
        for ix in range(x_first, x_last + 1):
            px = origin_m[0] + (ix + 0.5) * block_m - shift[0]
            for iy in range(y_first, y_last + 1):
                py = origin_m[1] + (iy + 0.5) * block_m - shift[1]
                u = turn[0, 0] * px + turn[1, 0] * py
                v = turn[0, 1] * px + turn[1, 1] * py
                w = turn[0, 2] * px + turn[1, 2] * py
                for iz in range(z_first, z_last + 1):
                    block = (ix * shape[1] + iy) * shape[2] + iz
                    known = seen[block] - base_mark
                    n_below = known if 0 <= known < n_bands else n_bands
                    if n_below == 0:
                        continue
                    pz = origin_m[2] + (iz + 0.5) * block_m - shift[2]
                    at = (u + turn[2, 0] * pz, v + turn[2, 1] * pz, w + turn[2, 2] * pz)
                    band = _band(distance, grid, turn, *at, half_m, within_m, n_below)
                    if band == n_below:
                        continue
                    seen[block] = base_mark + band
                    if listed[block] != mark:
                        if n_out >= len(out):
                            return -1
                        listed[block] = mark
                        out[n_out] = block
                        n_out += 1
    return n_out


@leaf
def _blocks_along(box, axis):  # type: ignore[no-untyped-def]
    """First and last block along an axis whose middle may be within ``room`` of a body's box.

    ``box``: (grids, body, its frame's rotation and translation, ``room``, then origin, shape and edge of the blocks).
    """
    grids, b, turn, shift, room, origin_m, shape, block_m = box
    middle, half = shift[axis], room
    for i in range(3):
        low, high = grids.box_min_m[b, i], grids.box_max_m[b, i]
        middle += turn[axis, i] * (low + high) / 2.0
        half += abs(turn[axis, i]) * (high - low) / 2.0
    first = max(0, math.ceil((middle - half - origin_m[axis]) / block_m - 0.5))
    return first, min(shape[axis] - 1, math.floor((middle + half - origin_m[axis]) / block_m - 0.5))


@kernel
def _close_row(n_bands, mark, seen, out, n_from, n_to):  # type: ignore[no-untyped-def]
    """Turn the blocks ``out[n_from:n_to]`` into entries, ascending."""
    for i in range(n_from, n_to):
        out[i] = out[i] * n_bands + (seen[out[i]] - mark * (n_bands + 1))
    out[n_from:n_to].sort()


@kernel
def node_bands(arm, reach, blocks, within_m, q_rad, first, stamp, out, offset):  # type: ignore[no-untyped-def]
    """Entries of the neurons ``q_rad`` (n, J) one after another into ``out``; row k ends at ``offset[k + 1]``, ``offset[0]`` is 0.

    ``stamp`` (2 n_blocks,) int64, its values never reached by ``first`` and what follows times (L + 1). Returns the number of neurons
    done: fewer than n when ``out`` was full.
    """
    n_joints, n_blocks = q_rad.shape[1], len(stamp) // 2
    seen, listed = stamp[:n_blocks], stamp[n_blocks:]
    rotation, translation = np.empty((n_joints + 1, 3, 3)), np.empty((n_joints + 1, 3))
    n_out = 0
    for k in range(len(q_rad)):
        forward_kinematics(arm.chain, q_rad[k], rotation, translation)
        n = _pose_bands(arm, reach, blocks, within_m, rotation, translation, first + k, seen, listed, out, n_out)
        if n < 0:
            return k
        _close_row(len(within_m), first + k, seen, out, n_out, n)
        n_out = n
        offset[k + 1] = n_out
    return len(q_rad)


@kernel
def edge_bands(arm, reach, blocks, within_m, step_m, q_rad, edges, node_offset, node_entry, first, stamp, out, offset):  # type: ignore[no-untyped-def]
    """Entries of edges (m, 2): blocks to which an edge comes nearer, by a band or more, than both of its ends do.

    The straight joint segment is sampled so that no point of the arm moves by more than ``step_m`` between samples. Other arguments as
    for :func:`node_bands`.
    """
    n_joints, n_blocks, n_bands = q_rad.shape[1], len(stamp) // 2, len(within_m)
    seen, listed = stamp[:n_blocks], stamp[n_blocks:]
    rotation, translation = np.empty((2, n_joints + 1, 3, 3)), np.empty((2, n_joints + 1, 3))
    dq, q = q_rad[0].copy(), q_rad[0].copy()
    n_out = 0
    for k in range(len(edges)):
        mark = first + k
        base_mark = mark * (n_bands + 1)
        a, b = edges[k, 0], edges[k, 1]
        for end in (a, b):
            for i in range(node_offset[end], node_offset[end + 1]):
                block, band = node_entry[i] // n_bands, node_entry[i] % n_bands
                known = seen[block] - base_mark
                if not (0 <= known <= band):
                    seen[block] = base_mark + band
        for j in range(n_joints):
            dq[j] = q_rad[b, j] - q_rad[a, j]
        n_steps = segment_steps(arm, q_rad[a], dq, step_m, rotation, translation)
        n = n_out
        for s in range(1, n_steps):
            for j in range(n_joints):
                q[j] = q_rad[a, j] + dq[j] * (s / n_steps)
            forward_kinematics(arm.chain, q, rotation[0], translation[0])
            n = _pose_bands(arm, reach, blocks, within_m, rotation[0], translation[0], mark, seen, listed, out, n)
            if n < 0:
                return k
        _close_row(n_bands, mark, seen, out, n_out, n)
        n_out = n
        offset[k + 1] = n_out
    return len(edges)
