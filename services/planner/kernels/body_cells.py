"""One body of the arm against occupied cells: does a cell block it, and how far may it move until one could.

A cell blocks a body if any of its points may be nearer to it than the safety distance. The cell is a cube; where its ball decides, no
more is looked at, else its eight octants are, and where an octant's ball leaves it open, the octant's eight parts.

Twin: ``tests/support/slow_planner.py``.
"""

from __future__ import annotations

import math

import numpy as np

from common.kernel import inlined, leaf
from common.robot.body_distance import cover_distance, to_world
from common.robot.kernels import FAR, body_grid, look_close, look_up, to_joint_frame
from services.planner.kernels.cells import BLOCK, GROUP

__all__ = ["ROOT3", "body_cell_gap", "cell_touches_body", "octant_middle"]

ROOT3 = math.sqrt(3.0)
COVER_LOOK_M = 0.02  # how far the covering spheres look beyond the distance grids' reach; our choice


@leaf
def cell_touches_body(distance, grid, rotation, x, y, z, half_m, safety_m):  # type: ignore[no-untyped-def]
    """Whether the cube around (x, y, z), given in the body's frame, may come within ``safety_m`` of a body.

    ``distance, grid``: as for :func:`common.robot.kernels.look_up`. ``rotation`` (3, 3) is the frame's; its rows are the world axes, along
    which the cube lies. Never false when it truly does; when true, the cube is within ``safety_m`` + an eighth of its diagonal + rounding
    of the distance grid.
    """
    return look_up(distance, grid, x, y, z) <= safety_m + half_m * ROOT3 and (
        _cube_room(distance, grid, rotation, x, y, z, half_m, safety_m) <= 0.0
    )


@leaf
def _cube_room(distance, grid, rotation, x, y, z, half_m, safety_m):  # type: ignore[no-untyped-def]
    """How far a body may move until it could come within ``safety_m`` of a cube (a lower bound, in metres); 0 where it may be now.

    The cube's ball is looked at, where that leaves it open its octants' balls, and theirs. Arguments: :func:`cell_touches_body`.
    """
    inner, outer = safety_m + half_m, safety_m + half_m * ROOT3
    centre = look_close(distance, grid, x, y, z, inner, outer)
    if centre > outer:
        return centre - outer
    if centre <= inner:
        return 0.0
    room = np.inf
    inner_octant, outer_octant, outer_part = safety_m + 0.5 * half_m, safety_m + 0.5 * half_m * ROOT3, safety_m + 0.25 * half_m * ROOT3
    for octant in range(8):
        ox, oy, oz = octant_middle(rotation, x, y, z, 0.5 * half_m, octant)
        middle = look_close(distance, grid, ox, oy, oz, inner_octant, outer_octant)
        if middle > outer_octant:
            room = min(room, middle - outer_octant)
            continue
        if middle <= inner_octant:
            return 0.0
        for part in range(8):
            px, py, pz = octant_middle(rotation, ox, oy, oz, 0.25 * half_m, part)
            near = look_close(distance, grid, px, py, pz, outer_part, outer_part)
            if near <= outer_part:
                return 0.0
            room = min(room, near - outer_part)
    return room


@leaf
def octant_middle(rotation, x, y, z, step_m, octant):  # type: ignore[no-untyped-def]
    """``step_m`` along each world axis from (x, y, z), in the body's frame; the bits of ``octant`` say which way."""
    sx = step_m if octant & 1 else -step_m
    sy = step_m if octant & 2 else -step_m
    sz = step_m if octant & 4 else -step_m
    return (
        x + sx * rotation[0, 0] + sy * rotation[1, 0] + sz * rotation[2, 0],
        y + sx * rotation[0, 1] + sy * rotation[1, 1] + sz * rotation[2, 1],
        z + sx * rotation[0, 2] + sy * rotation[1, 2] + sz * rotation[2, 2],
    )


@inlined
def body_cell_gap(arm, cells, b, safety_m, turn, shift):  # type: ignore[no-untyped-def]  # noqa: PLR0912  one search; parts cost calls
    """``(cell, gap)``: a cell that blocks body ``b``, or -1 and how far the body may move until one could (a lower bound, in metres).

    ``turn`` (3, 3), ``shift`` (3,): the body's frame. What is farther than the gap found so far is ruled out by spheres about groups and
    blocks of cells and by the box and the parts of the body. A near block is looked at first, so that this is most of them. Where
    ``safety_m`` is more than the distance grids can tell, the spheres that cover the body answer.
    """
    grids = arm.grids
    distance, centre, block, group, half_m = grids.distance, cells.centre_m, cells.block_m, cells.group_m, cells.half_m
    reach = safety_m + half_m * ROOT3
    grid = body_grid(grids, b)
    bx, by, bz = to_world(turn, shift, grids.bound_centre_m, b)
    around = grids.bound_radius_m[b] + reach
    gap = np.inf
    first = _near_block(block, group, bx, by, bz)
    for g in range(-1, len(group)):
        if g >= 0 and _squared(group[g, 0] - bx, group[g, 1] - by, group[g, 2] - bz) >= (around + group[g, 3] + gap) ** 2:
            continue
        for k in range(g * GROUP, min((g + 1) * GROUP, len(block))) if g >= 0 else range(first, min(first + 1, len(block))):
            if _squared(block[k, 0] - bx, block[k, 1] - by, block[k, 2] - bz) >= (around + block[k, 3] + gap) ** 2:
                continue
            kx, ky, kz = to_joint_frame(turn, shift, block[k, 0], block[k, 1], block[k, 2])
            if _to_box2(grids.box_min_m, grids.box_max_m, b, kx, ky, kz) >= (reach + block[k, 3] + gap) ** 2:
                continue
            for p in range(grids.part_offset[b], grids.part_offset[b + 1]):
                near = grids.part_m[p, 3] + reach
                apart2 = _squared(kx - grids.part_m[p, 0], ky - grids.part_m[p, 1], kz - grids.part_m[p, 2])
                if apart2 >= (near + block[k, 3] + gap) ** 2:
                    continue
                room = math.sqrt(apart2) - near - block[k, 3]
                if room > 0.0:
                    gap = room
                    continue
                px, py, pz = to_world(turn, shift, grids.part_m, p)
                for i in range(k * BLOCK, min((k + 1) * BLOCK, len(centre))):
                    apart2 = _squared(centre[i, 0] - px, centre[i, 1] - py, centre[i, 2] - pz)
                    if apart2 >= (near + gap) ** 2:
                        continue
                    room = math.sqrt(apart2) - near
                    if room <= 0.0:
                        x, y, z = to_joint_frame(turn, shift, centre[i, 0], centre[i, 1], centre[i, 2])
                        if reach > FAR:
                            room = cover_distance(grids, b, x, y, z, reach + COVER_LOOK_M) - reach
                        else:
                            room = look_up(distance, grid, x, y, z) - reach
                            if room <= 0.0:
                                room = _cube_room(distance, grid, turn, x, y, z, half_m, safety_m)
                        if room <= 0.0:
                            return i, 0.0
                    gap = min(gap, room)
    return -1, gap


@leaf
def _near_block(block, group, x, y, z):  # type: ignore[no-untyped-def]
    """The block nearest to (x, y, z) by its middle, in the group nearest by its middle; 0 if there is none."""
    best, near, best_block, near_block = np.inf, 0, np.inf, 0
    for g in range(len(group)):
        apart2 = _squared(group[g, 0] - x, group[g, 1] - y, group[g, 2] - z)
        if apart2 < best:
            best, near = apart2, g
    for k in range(near * GROUP, min((near + 1) * GROUP, len(block))):
        apart2 = _squared(block[k, 0] - x, block[k, 1] - y, block[k, 2] - z)
        if apart2 < best_block:
            best_block, near_block = apart2, k
    return near_block


@leaf
def _squared(dx, dy, dz):  # type: ignore[no-untyped-def]
    return dx * dx + dy * dy + dz * dz


@leaf
def _to_box2(low, high, b, x, y, z):  # type: ignore[no-untyped-def]
    """Squared distance from (x, y, z) to the box from ``low`` to ``high``, row ``b`` of each."""
    return _squared(
        max(low[b, 0] - x, x - high[b, 0], 0.0),
        max(low[b, 1] - y, y - high[b, 1], 0.0),
        max(low[b, 2] - z, z - high[b, 2], 0.0),
    )
