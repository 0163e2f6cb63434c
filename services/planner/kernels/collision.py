"""The one collision check: a pose of the arm against cells, exact static shapes, and itself.

Table, edges, connections, curves, repairs, stops and training motions all end here. Each test errs to the safe side only, and tells by
how much it may change until its answer could: along a way most are not asked again (:class:`Slack`).

* **cells**: a cell blocks a pose if any of its points may be nearer to a moving body than the safety distance. The cell is a cube; where
  its ball decides, no more is looked at, else its eight octants are, and where an octant's ball leaves it open, the octant's eight parts.
* **static layer**: boxes, spheres and cylinders by their exact distance to the spheres that cover a body.
* **self**: spheres of one body in the distance grid of the other.

Twin of the cells: ``tests/support/slow_planner.py``; of the slack: ``tests/unit/planner/test_slack.py``; referee: coal on the bare meshes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from common.kernel import kernel, leaf
from common.robot.body_distance import cover_distance, pair_distance, to_world
from common.robot.kernels import FAR, BodyGrids, Chain, body_grid, forward_kinematics, look_close, look_up, to_joint_frame
from common.robot.pair_tables import PairTables, table_distance
from services.planner.kernels.cells import BLOCK, GROUP
from services.planner.kernels.static_layer import body_static_gap

__all__ = [
    "FREE",
    "HIT_CELL",
    "HIT_SELF",
    "HIT_STATIC",
    "Arm",
    "Slack",
    "body_cell_gap",
    "cell_touches_body",
    "cells_that_hit",
    "farthest_m",
    "frames_verdict",
    "no_slack",
    "octant_middle",
    "pair_gap",
    "pose_hits_cell",
    "pose_is_free",
    "pose_verdict",
    "spend",
    "tabled_gap",
    "way_verdict",
]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]

FREE, HIT_CELL, HIT_STATIC, HIT_SELF = 0, 1, 2, 3
ROOT3 = math.sqrt(3.0)
PAIR_FINE_M = 0.01  # pairs with less room than that beyond the margin are measured sphere by sphere; our choice
COVER_LOOK_M = 0.02  # the same of cells beyond the distance grids' reach; our choice


class Arm(NamedTuple):
    """The arm as the checks see it."""

    chain: Chain
    grids: BodyGrids
    moving: U8  # (B,) 0 for bodies that stand in the world and are not checked against it
    pairs: I64  # (P, 2) bodies that can touch one another
    pair_tables: PairTables  # distances of those of them that are two joints apart
    static_margin_m: float  # kept from exact static shapes
    pair_margin_m: F64  # (P,) kept between the two bodies
    lever_m: F64  # (B, J) farthest that any point of a body moves, in metres per radian of a joint, in any pose
    pair_lever_m: F64  # (P, J) the same for one body of a pair as seen from the other


class Slack(NamedTuple):
    """How far in metres the arm may still move until a look could tell anything new; zero or less: look."""

    cell_m: F64  # (B,) of each body against cells
    static_m: F64  # (B,) against the static layer
    pair_m: F64  # (P,) of each pair against one another


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


@leaf
def body_cell_gap(arm, cells, b, safety_m, turn, shift):  # type: ignore[no-untyped-def]  # noqa: PLR0912  one search, no parts
    """``(cell, gap)``: a cell that blocks body ``b``, or -1 and how far the body may move until one could (a lower bound, in metres).

    ``turn`` (3, 3), ``shift`` (3,): the body's frame. Where ``safety_m`` is more than the distance grids can tell, the spheres that cover
    the body answer.
    """
    grids = arm.grids
    distance, centre, block, group, half_m = grids.distance, cells.centre_m, cells.block_m, cells.group_m, cells.half_m
    reach = safety_m + half_m * ROOT3
    beyond_grids = reach > FAR
    grid = body_grid(grids, b)
    bx, by, bz = to_world(turn, shift, grids.bound_centre_m, b)
    around = grids.bound_radius_m[b] + reach
    gap = np.inf
    for g in range(len(group)):
        dx, dy, dz = group[g, 0] - bx, group[g, 1] - by, group[g, 2] - bz
        least = around + group[g, 3] + gap
        if dx * dx + dy * dy + dz * dz >= least * least:  # farther than what was found already
            continue
        for k in range(g * GROUP, min((g + 1) * GROUP, len(block))):
            dx, dy, dz = block[k, 0] - bx, block[k, 1] - by, block[k, 2] - bz
            least = around + block[k, 3] + gap
            if dx * dx + dy * dy + dz * dz >= least * least:
                continue
            for p in range(grids.part_offset[b], grids.part_offset[b + 1]):
                cx, cy, cz = to_world(turn, shift, grids.part_m, p)
                near = grids.part_m[p, 3] + reach
                dx, dy, dz = block[k, 0] - cx, block[k, 1] - cy, block[k, 2] - cz
                apart2, least = dx * dx + dy * dy + dz * dz, near + block[k, 3] + gap
                if apart2 >= least * least:
                    continue
                room = math.sqrt(apart2) - near - block[k, 3]
                if room > 0.0:
                    gap = room
                    continue
                for i in range(k * BLOCK, min((k + 1) * BLOCK, len(centre))):
                    x, y, z = centre[i, 0], centre[i, 1], centre[i, 2]
                    dx, dy, dz = x - cx, y - cy, z - cz
                    apart2, least = dx * dx + dy * dy + dz * dz, near + gap
                    if apart2 >= least * least:
                        continue
                    room = math.sqrt(apart2) - near
                    if room <= 0.0:
                        x, y, z = to_joint_frame(turn, shift, x, y, z)
                        if beyond_grids:
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
def pose_hits_cell(arm, cells, safety_m, rotation, translation):  # type: ignore[no-untyped-def]
    """Index of a cell that blocks the pose with frames ``rotation`` (J + 1, 3, 3), ``translation`` (J + 1, 3), or -1."""
    for b in range(len(arm.moving)):
        if arm.moving[b]:
            j = arm.grids.body_joint[b]
            i, _ = body_cell_gap(arm, cells, b, safety_m, rotation[j], translation[j])
            if i >= 0:
                return i
    return -1


@leaf
def cells_that_hit(arm, cells, safety_m, rotation, translation, hit):  # type: ignore[no-untyped-def]
    """Set ``hit`` (C,) uint8 for every cell that blocks the pose with the given frames; arguments as :func:`pose_hits_cell`."""
    grids = arm.grids
    distance, centre, half_m = grids.distance, cells.centre_m, cells.half_m
    hit[:] = 0
    for b in range(len(arm.moving)):
        if not arm.moving[b]:
            continue
        turn, shift, grid = rotation[grids.body_joint[b]], translation[grids.body_joint[b]], body_grid(grids, b)
        for i in range(len(centre)):
            x, y, z = to_joint_frame(turn, shift, centre[i, 0], centre[i, 1], centre[i, 2])
            if not hit[i] and cell_touches_body(distance, grid, turn, x, y, z, half_m, safety_m):
                hit[i] = 1


@leaf
def pair_gap(arm, p, rotation, translation):  # type: ignore[no-untyped-def]
    """How far pair ``p``'s bodies may move against one another until they could touch (a lower bound, in metres); zero or less: now."""
    grids, a, b = arm.grids, arm.pairs[p, 0], arm.pairs[p, 1]
    return pair_distance(grids, a, b, rotation, translation, arm.pair_margin_m[p] + PAIR_FINE_M) - arm.pair_margin_m[p]


@leaf
def tabled_gap(arm, p, q_rad):  # type: ignore[no-untyped-def]
    """:func:`pair_gap` by the table, without any frame; zero or less: the table cannot tell, or pair ``p`` has none."""
    return table_distance(arm.pair_tables, p, q_rad) - arm.pair_margin_m[p] if arm.pair_tables.table[p] >= 0 else 0.0


@leaf
def frames_verdict(arm, solids, cells, safety_m, q_rad, rotation, translation, slack):  # type: ignore[no-untyped-def]
    """``(FREE | HIT_CELL | HIT_STATIC | HIT_SELF, index of what is hit)`` of the pose ``q_rad`` (J,) with the given frames.

    Only what has no ``slack`` left is looked at, and gets new slack.
    """
    grids = arm.grids
    for b in range(len(arm.moving)):
        if arm.moving[b] and slack.cell_m[b] <= 0.0:
            i, slack.cell_m[b] = body_cell_gap(arm, cells, b, safety_m, rotation[grids.body_joint[b]], translation[grids.body_joint[b]])
            if i >= 0:
                return HIT_CELL, i
    for b in range(len(arm.moving)):
        if arm.moving[b] and slack.static_m[b] <= 0.0:
            turn, shift = rotation[grids.body_joint[b]], translation[grids.body_joint[b]]
            slack.static_m[b], i = body_static_gap(grids, solids, b, turn, shift, arm.static_margin_m)
            if i >= 0:
                return HIT_STATIC, i
    for p in range(len(arm.pairs)):
        if slack.pair_m[p] <= 0.0:
            slack.pair_m[p] = tabled_gap(arm, p, q_rad)
            if slack.pair_m[p] <= 0.0:
                slack.pair_m[p] = pair_gap(arm, p, rotation, translation)
            if slack.pair_m[p] <= 0.0:
                return HIT_SELF, p
    return FREE, -1


@kernel
def no_slack(arm):  # type: ignore[no-untyped-def]
    """The slack of a pose of which nothing is known."""
    return Slack(np.zeros(len(arm.moving)), np.zeros(len(arm.moving)), np.zeros(len(arm.pairs)))


@leaf
def spend(arm, turned_rad, step_m, slack):  # type: ignore[no-untyped-def]
    """Take from ``slack`` what the arm may have moved while its joints turned by at most ``turned_rad`` (J,) each.

    ``step_m``: what no point of the arm outran. Returns whether anything has no slack left and must be looked at.
    """
    look = False
    n_joints = len(turned_rad)
    for b in range(len(arm.moving)):
        if not arm.moving[b]:
            continue
        moved_m = 0.0
        for j in range(n_joints):
            moved_m += turned_rad[j] * arm.lever_m[b, j]
        moved_m = min(moved_m, step_m)
        slack.cell_m[b] -= moved_m
        slack.static_m[b] -= moved_m
        look = look or slack.cell_m[b] <= 0.0 or slack.static_m[b] <= 0.0
    for p in range(len(arm.pairs)):
        moved_m = 0.0
        for j in range(n_joints):
            moved_m += turned_rad[j] * arm.pair_lever_m[p, j]
        slack.pair_m[p] -= min(moved_m, 2.0 * step_m)
        look = look or slack.pair_m[p] <= 0.0
    return look


@leaf
def farthest_m(arm, turned_rad):  # type: ignore[no-untyped-def]
    """Farthest in metres that any point of the moving bodies can move while the joints turn by at most ``turned_rad`` (J,) each."""
    farthest = 0.0
    for b in range(len(arm.moving)):
        moved_m = 0.0
        for j in range(len(turned_rad)):
            moved_m += turned_rad[j] * arm.lever_m[b, j]
        farthest = max(farthest, moved_m)
    return farthest


@leaf
def way_verdict(arm, solids, cells, safety_m, q_rad, turned_rad, step_m, slack, rotation, translation):  # type: ignore[no-untyped-def]
    """:func:`frames_verdict` of the next pose ``q_rad`` (J,) along a way, ``turned_rad`` (J,) and ``step_m`` from the one before."""
    if not spend(arm, turned_rad, step_m, slack):
        return FREE, -1
    forward_kinematics(arm.chain, q_rad, rotation, translation)
    return frames_verdict(arm, solids, cells, safety_m, q_rad, rotation, translation, slack)


@kernel
def pose_verdict(arm, solids, cells, safety_m, q_rad, rotation, translation):  # type: ignore[no-untyped-def]
    """:func:`frames_verdict` of ``q_rad`` (J,) by itself. ``rotation`` (J + 1, 3, 3), ``translation`` (J + 1, 3): scratch."""
    forward_kinematics(arm.chain, q_rad, rotation, translation)
    return frames_verdict(arm, solids, cells, safety_m, q_rad, rotation, translation, no_slack(arm))


@leaf
def pose_is_free(arm, solids, cells, safety_m, q_rad, rotation, translation):  # type: ignore[no-untyped-def]
    """Whether ``q_rad`` (J,) hits nothing; arguments as :func:`pose_verdict`."""
    forward_kinematics(arm.chain, q_rad, rotation, translation)
    if pose_hits_cell(arm, cells, safety_m, rotation, translation) >= 0:
        return False
    for b in range(len(arm.moving)):
        j = arm.grids.body_joint[b]
        if arm.moving[b] and body_static_gap(arm.grids, solids, b, rotation[j], translation[j], arm.static_margin_m)[1] >= 0:
            return False
    for p in range(len(arm.pairs)):  # noqa: SIM110  a generator is not for kernels
        if tabled_gap(arm, p, q_rad) <= 0.0 and pair_gap(arm, p, rotation, translation) <= 0.0:
            return False
    return True
