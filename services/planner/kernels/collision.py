"""The one collision check: a pose of the arm against cells, exact static shapes, and itself.

Table, edges, connections, curves, repairs, stops and training motions all end here. Each test errs to the safe side only, and tells by
how much it may change until its answer could: along a way most are not asked again (:class:`Slack`).

* **cells**: a cell blocks a pose if any of its points may be nearer to a moving body than the safety distance
  (:mod:`services.planner.kernels.body_cells`).
* **static layer**: boxes, spheres and cylinders by their exact distance to the spheres that cover a body.
* **self**: spheres of one body in the distance grid of the other.

Twin of the cells: ``tests/support/slow_planner.py``; of the slack: ``tests/unit/planner/test_slack.py``; referee: coal on the bare meshes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from common.kernel import inlined, kernel, leaf
from common.robot.body_distance import pair_distance
from common.robot.kernels import BodyGrids, Chain, body_grid, forward_kinematics, to_joint_frame
from common.robot.pair_tables import PairTables, table_distance
from services.planner.kernels.body_cells import body_cell_gap, cell_touches_body
from services.planner.kernels.static_layer import body_static_gap

__all__ = [
    "FREE",
    "HIT_CELL",
    "HIT_SELF",
    "HIT_STATIC",
    "Arm",
    "Slack",
    "cells_that_hit",
    "farthest_m",
    "frames_verdict",
    "no_slack",
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
PAIR_FINE_M = 0.01  # pairs with less room than that beyond the margin are measured sphere by sphere; our choice


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


@inlined
def pair_gap(arm, p, rotation, translation):  # type: ignore[no-untyped-def]
    """How far pair ``p``'s bodies may move against one another until they could touch (a lower bound, in metres); zero or less: now."""
    grids, a, b = arm.grids, arm.pairs[p, 0], arm.pairs[p, 1]
    return pair_distance(grids, a, b, rotation, translation, arm.pair_margin_m[p] + PAIR_FINE_M) - arm.pair_margin_m[p]


@inlined
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
