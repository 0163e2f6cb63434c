"""The one collision check: a pose of the arm against cells, exact static shapes, and itself.

Table, edges, connections, curves, repairs, stops and training motions all end here. Each test errs to the safe side only:

* **cells**: a cell blocks a pose if any of its points may be nearer to a moving body than the safety distance. The cell is a cube; where
  its ball decides, no more is looked at, else its eight octants are.
* **static layer**: boxes, spheres and cylinders by their exact distance to the spheres that cover a body.
* **self**: spheres of one body in the distance grid of the other.

Twin: ``tests/support/slow_collision.py``; referee: coal on the bare meshes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from common.robot.body_distance import cover_distance, pair_distance, to_world
from common.robot.kernels import FAR, TENTH_MM, BodyGrids, Chain, body_grid, forward_kinematics, look_up, to_joint_frame

__all__ = [
    "BLOCK",
    "BOX",
    "CYLINDER",
    "FREE",
    "HIT_CELL",
    "HIT_SELF",
    "HIT_STATIC",
    "SPHERE",
    "Arm",
    "Cells",
    "Solids",
    "block_bounds",
    "cell_touches_body",
    "cells_that_hit",
    "displacement_m",
    "frames_verdict",
    "pose_hits_cell",
    "pose_is_free",
    "pose_verdict",
    "static_clearance",
]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]

FREE, HIT_CELL, HIT_STATIC, HIT_SELF = 0, 1, 2, 3
BOX, SPHERE, CYLINDER = 0, 1, 2
BLOCK = 16  # cells that share a bounding sphere; our choice
ROOT3 = math.sqrt(3.0)
LOOK_M = 0.1  # how far beyond the margin the static layer is measured, to know how long it needs no look; our choice


class Arm(NamedTuple):
    """The arm as the checks see it."""

    chain: Chain
    grids: BodyGrids
    moving: U8  # (B,) 0 for bodies that stand in the world and are not checked against it
    pairs: I64  # (P, 2) bodies that can touch one another
    static_margin_m: float  # kept from exact static shapes
    self_margin_m: float  # kept between bodies of the arm


class Solids(NamedTuple):
    """S exact static shapes: ``size_m`` box half extents; sphere [radius]; cylinder [radius, half length along z]."""

    kind: I64  # (S,) BOX, SPHERE, CYLINDER
    size_m: F64  # (S, 3)
    rotation: F64  # (S, 3, 3) world <- solid
    translation: F64  # (S, 3)


class Cells(NamedTuple):
    """Occupied cells in space order, with a bounding sphere for every ``BLOCK`` of them."""

    centre_m: F64  # (C, 3)
    block_m: F64  # (ceil(C / BLOCK), 4) centre and radius that contain the blocks' centres
    half_m: float  # half the edge of a cell


@njit(cache=True, nogil=True)
def block_bounds(centre_m, block_m):  # type: ignore[no-untyped-def]
    """Fill ``block_m`` (n, 4) with bounding spheres of each ``BLOCK`` rows of ``centre_m`` (C, 3)."""
    for k in range(len(block_m)):
        first, last = k * BLOCK, min((k + 1) * BLOCK, len(centre_m))
        for axis in range(3):
            low, high = centre_m[first, axis], centre_m[first, axis]
            for i in range(first + 1, last):
                low, high = min(low, centre_m[i, axis]), max(high, centre_m[i, axis])
            block_m[k, axis] = (low + high) / 2.0
        radius2 = 0.0
        for i in range(first, last):
            d2 = 0.0
            for axis in range(3):
                d2 += (centre_m[i, axis] - block_m[k, axis]) ** 2
            radius2 = max(radius2, d2)
        block_m[k, 3] = math.sqrt(radius2)


@njit(cache=True, nogil=True, inline="always")
def cell_touches_body(distance, grid, rotation, x, y, z, half_m, safety_m):  # type: ignore[no-untyped-def]
    """Whether the cube around (x, y, z), given in the body's frame, may come within ``safety_m`` of a body.

    ``distance, grid``: as for :func:`common.robot.kernels.look_up`. ``rotation`` (3, 3) is the frame's; its rows are the world axes, along
    which the cube lies. Never false when it truly does; when true, the cube is within ``safety_m`` + a quarter of its diagonal + rounding
    of the distance grid.
    """
    centre = look_up(distance, grid, x, y, z)
    if centre > safety_m + half_m * ROOT3:
        return False
    if centre <= safety_m + half_m:
        return True
    quarter = 0.5 * half_m
    limit = safety_m + quarter * ROOT3
    for octant in range(8):
        sx = quarter if octant & 1 else -quarter
        sy = quarter if octant & 2 else -quarter
        sz = quarter if octant & 4 else -quarter
        ox = x + sx * rotation[0, 0] + sy * rotation[1, 0] + sz * rotation[2, 0]
        oy = y + sx * rotation[0, 1] + sy * rotation[1, 1] + sz * rotation[2, 1]
        oz = z + sx * rotation[0, 2] + sy * rotation[1, 2] + sz * rotation[2, 2]
        if look_up(distance, grid, ox, oy, oz) <= limit:
            return True
    return False


@njit(cache=True, nogil=True)
def pose_hits_cell(arm, cells, safety_m, rotation, translation):  # type: ignore[no-untyped-def]
    """Index of a cell that blocks the pose with frames ``rotation`` (J + 1, 3, 3), ``translation`` (J + 1, 3), or -1.

    Where ``safety_m`` is more than the distance grids can tell, the spheres that cover the bodies answer.
    """
    grids = arm.grids
    distance, centre, block, half_m = grids.distance, cells.centre_m, cells.block_m, cells.half_m
    reach = safety_m + half_m * ROOT3
    beyond_grids = reach > FAR
    for b in range(len(arm.moving)):
        if not arm.moving[b]:
            continue
        j = grids.body_joint[b]
        turn, shift, grid = rotation[j], translation[j], body_grid(grids, b)
        cx, cy, cz = to_world(turn, shift, grids.bound_centre_m, b)
        near = grids.bound_radius_m[b] + reach
        near2 = near * near
        for k in range(len(block)):
            dx, dy, dz = block[k, 0] - cx, block[k, 1] - cy, block[k, 2] - cz
            if dx * dx + dy * dy + dz * dz > (near + block[k, 3]) ** 2:
                continue
            for i in range(k * BLOCK, min((k + 1) * BLOCK, len(centre))):
                x, y, z = centre[i, 0], centre[i, 1], centre[i, 2]
                dx, dy, dz = x - cx, y - cy, z - cz
                if dx * dx + dy * dy + dz * dz > near2:
                    continue
                x, y, z = to_joint_frame(turn, shift, x, y, z)
                if beyond_grids:
                    if cover_distance(grids, b, x, y, z, reach + TENTH_MM) <= reach:
                        return i
                elif cell_touches_body(distance, grid, turn, x, y, z, half_m, safety_m):
                    return i
    return -1


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True)
def _solid_distance(kind, size_m, turn, shift, s, px, py, pz):  # type: ignore[no-untyped-def]
    """Signed distance in metres (negative inside) of a world point to solid ``s``; exact."""
    px, py, pz = px - shift[s, 0], py - shift[s, 1], pz - shift[s, 2]
    x = turn[s, 0, 0] * px + turn[s, 1, 0] * py + turn[s, 2, 0] * pz
    y = turn[s, 0, 1] * px + turn[s, 1, 1] * py + turn[s, 2, 1] * pz
    z = turn[s, 0, 2] * px + turn[s, 1, 2] * py + turn[s, 2, 2] * pz
    if kind[s] == SPHERE:
        return math.sqrt(x * x + y * y + z * z) - size_m[s, 0]
    if kind[s] == BOX:
        u, v, w = abs(x) - size_m[s, 0], abs(y) - size_m[s, 1], abs(z) - size_m[s, 2]
        outside = math.sqrt(max(u, 0.0) ** 2 + max(v, 0.0) ** 2 + max(w, 0.0) ** 2)
        return outside + min(max(u, v, w), 0.0)
    u, w = math.sqrt(x * x + y * y) - size_m[s, 0], abs(z) - size_m[s, 1]
    return math.sqrt(max(u, 0.0) ** 2 + max(w, 0.0) ** 2) + min(max(u, w), 0.0)


@njit(cache=True, nogil=True)
def static_clearance(arm, solids, rotation, translation, enough_m):  # type: ignore[no-untyped-def]
    """``(distance, solid)``: lower bound in metres of the distance of the moving bodies to the static layer, and to which solid.

    Distances of ``enough_m`` and more are not looked into: then ``enough_m`` is the answer, with -1.
    """
    grids = arm.grids
    kind, size, turn, shift = solids.kind, solids.size_m, solids.rotation, solids.translation
    groups, spheres, first = grids.group_m, grids.spheres_m, grids.group_sphere_offset
    best, which = enough_m, -1
    for b in range(len(arm.moving)):
        if not arm.moving[b]:
            continue
        frame, origin = rotation[grids.body_joint[b]], translation[grids.body_joint[b]]
        cx, cy, cz = to_world(frame, origin, grids.bound_centre_m, b)
        for s in range(len(kind)):
            if _solid_distance(kind, size, turn, shift, s, cx, cy, cz) - grids.bound_radius_m[b] >= best:
                continue
            for g in range(grids.group_offset[b], grids.group_offset[b + 1]):
                x, y, z = to_world(frame, origin, groups, g)
                if _solid_distance(kind, size, turn, shift, s, x, y, z) - groups[g, 3] >= best:
                    continue
                for p in range(first[g], first[g + 1]):
                    x, y, z = to_world(frame, origin, spheres, p)
                    distance = _solid_distance(kind, size, turn, shift, s, x, y, z) - spheres[p, 3]
                    if distance < best:
                        best, which = distance, s
    return best, which


@njit(cache=True, nogil=True)
def frames_verdict(arm, solids, cells, safety_m, rotation, translation, moved_m, slack):  # type: ignore[no-untyped-def]
    """``(FREE | HIT_CELL | HIT_STATIC | HIT_SELF, index of what is hit)`` of the pose with the given frames.

    Along a way the static layer is mostly far. ``slack`` (1,) remembers how far the arm may still move until it must be looked at again;
    ``moved_m`` is what it moved since the last call. Zero means: look. (The same for pairs of bodies does not pay: their measured
    distances end at the distance grids' reach, less than two steps.)
    """
    i = pose_hits_cell(arm, cells, safety_m, rotation, translation)
    if i >= 0:
        return HIT_CELL, i
    slack[0] -= moved_m
    if slack[0] <= 0.0:
        distance, i = static_clearance(arm, solids, rotation, translation, arm.static_margin_m + LOOK_M)
        if distance <= arm.static_margin_m:
            return HIT_STATIC, i
        slack[0] = distance - arm.static_margin_m
    enough_m = arm.self_margin_m + TENTH_MM  # distances are stored in tenths of a millimetre
    for p in range(len(arm.pairs)):
        if pair_distance(arm.grids, arm.pairs[p, 0], arm.pairs[p, 1], rotation, translation, enough_m) <= arm.self_margin_m:
            return HIT_SELF, p
    return FREE, -1


@njit(cache=True, nogil=True)
def pose_verdict(arm, solids, cells, safety_m, q_rad, rotation, translation):  # type: ignore[no-untyped-def]
    """:func:`frames_verdict` of ``q_rad`` (J,) by itself. ``rotation`` (J + 1, 3, 3), ``translation`` (J + 1, 3): scratch."""
    forward_kinematics(arm.chain, q_rad, rotation, translation)
    return frames_verdict(arm, solids, cells, safety_m, rotation, translation, 0.0, np.zeros(1))


@njit(cache=True, nogil=True)
def pose_is_free(arm, solids, cells, safety_m, q_rad, rotation, translation):  # type: ignore[no-untyped-def]
    """Whether ``q_rad`` (J,) hits nothing; arguments as :func:`pose_verdict`."""
    return pose_verdict(arm, solids, cells, safety_m, q_rad, rotation, translation)[0] == FREE


@njit(cache=True, nogil=True)
def displacement_m(arm, rotation_a, translation_a, rotation_b, translation_b):  # type: ignore[no-untyped-def]
    """Farthest in metres that any point of the moving bodies is apart in two poses, given by their frames.

    A body's points are mapped by one affine map, so none moves farther than the farthest corner of the body's box.
    """
    grids = arm.grids
    low, high = grids.box_min_m, grids.box_max_m
    largest2 = 0.0
    for b in range(len(arm.moving)):
        j = grids.body_joint[b]
        if j == 0:
            continue
        ra, ta, rb, tb = rotation_a[j], translation_a[j], rotation_b[j], translation_b[j]
        for corner in range(8):
            x = high[b, 0] if corner & 1 else low[b, 0]
            y = high[b, 1] if corner & 2 else low[b, 1]
            z = high[b, 2] if corner & 4 else low[b, 2]
            d2 = 0.0
            for r in range(3):
                d = tb[r] - ta[r] + (rb[r, 0] - ra[r, 0]) * x + (rb[r, 1] - ra[r, 1]) * y + (rb[r, 2] - ra[r, 2]) * z
                d2 += d * d
            largest2 = max(largest2, d2)
    return math.sqrt(largest2)
