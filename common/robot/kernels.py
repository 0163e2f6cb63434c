"""Numba kernels of the arm: forward kinematics of a serial chain, and distance to its bodies by table.

Everything is flat arrays in NamedTuples so that other kernels (planner, self-filter) can call these without Python in between.
Oracle of the kinematics: pinocchio (``tests/unit/robot``); twins of the rest: ``tests/support/slow_planner.py``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from common.kernel import copy_row, leaf

__all__ = [
    "FAR",
    "BodyGrids",
    "Chain",
    "body_distance",
    "body_grid",
    "forward_kinematics",
    "forward_kinematics_batch",
    "look_close",
    "look_near",
    "look_up",
    "to_joint_frame",
]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
I16 = NDArray[np.int16]

# Metres; the (true) lower bound answered for any point beyond a body's distance grid. Our choice: more than a safety distance of 2 cm plus
# half the diagonal of a 4 cm cell, and than the largest cover sphere plus 1.5 cm.
FAR = 0.06
TENTH_MM = 1e-4  # unit of the stored distances
OUT_M = 0.012  # how much farther out :func:`look_close` looks; measured: 0.01 to 0.02 are as good
SLACK_M = 1e-4  # measured: two of libigl's distances differ by up to 0.06 mm more than their points are apart
HALF_DIAGONAL = math.sqrt(3.0) / 2.0  # of a voxel, in its edges


class Chain(NamedTuple):
    """A serial arm of J joints. Frame 0 is the base, frame j moves with joint j (1..J)."""

    base_rotation: F64  # (3, 3) world <- base
    base_translation: F64  # (3,)
    rotation: F64  # (J, 3, 3) fixed placement of joint j+1 in frame j
    translation: F64  # (J, 3)
    axis: F64  # (J, 3) unit axis in the joint's own frame
    prismatic: NDArray[np.uint8]  # (J,) 1 where the joint slides


class BodyGrids(NamedTuple):
    """Distance tables and sphere covers of B rigid bodies, each in the frame of the joint that carries it.

    A voxel stores a lower bound of the signed distance (negative inside) of all its points, in tenths of a millimetre.
    """

    body_joint: I64  # (B,) frame index, 0 = base
    spacing_m: float
    origin_m: F64  # (B, 3) lowest corner of the grid
    shape: I64  # (B, 3)
    offset: I64  # (B + 1,) into distance
    distance: I16  # flat, x slowest
    box_min_m: F64  # (B, 3) bounding box of the bare body
    box_max_m: F64  # (B, 3)
    bound_centre_m: F64  # (B, 3) bounding sphere of the bare body
    bound_radius_m: F64  # (B,)
    part_m: F64  # (Q, 4) x, y, z, radius: few spheres that together contain the whole body; what is not near them is not looked into
    part_offset: I64  # (B + 1,) into part_m
    spheres_m: F64  # (S, 4) x, y, z, radius: together they cover the body's outer surface
    group_m: F64  # (G, 4) bounding spheres of groups of neighbouring spheres
    group_sphere_offset: I64  # (G + 1,) into spheres_m
    group_offset: I64  # (B + 1,) into group_m


@leaf
def forward_kinematics(chain, q_rad, rotation, translation):  # type: ignore[no-untyped-def]
    """World poses of all frames: fills ``rotation`` (J + 1, 3, 3) and ``translation`` (J + 1, 3) for ``q_rad`` (J,).

    Source: product of fixed placement and joint motion (Rodrigues' formula about the joint's axis), as in any robotics text.
    """
    for r in range(3):
        copy_row(chain.base_rotation[r], rotation[0, r])
    copy_row(chain.base_translation, translation[0])
    for j in range(len(q_rad)):
        parent, placed, fixed = rotation[j], rotation[j + 1], chain.rotation[j]
        for r in range(3):
            translation[j + 1, r] = translation[j, r]
            for c in range(3):
                translation[j + 1, r] += parent[r, c] * chain.translation[j, c]
                placed[r, c] = parent[r, 0] * fixed[0, c] + parent[r, 1] * fixed[1, c] + parent[r, 2] * fixed[2, c]
        x, y, z = chain.axis[j, 0], chain.axis[j, 1], chain.axis[j, 2]
        if chain.prismatic[j]:
            for r in range(3):
                translation[j + 1, r] += q_rad[j] * (placed[r, 0] * x + placed[r, 1] * y + placed[r, 2] * z)
            continue
        s, cosine = math.sin(q_rad[j]), math.cos(q_rad[j])
        k = 1.0 - cosine
        m00, m01, m02 = cosine + x * x * k, x * y * k - z * s, x * z * k + y * s
        m10, m11, m12 = y * x * k + z * s, cosine + y * y * k, y * z * k - x * s
        m20, m21, m22 = z * x * k - y * s, z * y * k + x * s, cosine + z * z * k
        for r in range(3):
            a, b, d = placed[r, 0], placed[r, 1], placed[r, 2]
            placed[r, 0] = a * m00 + b * m10 + d * m20
            placed[r, 1] = a * m01 + b * m11 + d * m21
            placed[r, 2] = a * m02 + b * m12 + d * m22


@leaf
def forward_kinematics_batch(chain, q_rad, rotation, translation):  # type: ignore[no-untyped-def]
    """:func:`forward_kinematics` for ``q_rad`` (K, J) into (K, J + 1, 3, 3) and (K, J + 1, 3)."""
    for k in range(len(q_rad)):
        forward_kinematics(chain, q_rad[k], rotation[k], translation[k])


@leaf
def to_joint_frame(rotation, translation, x, y, z):  # type: ignore[no-untyped-def]
    """World point into the frame with pose ``rotation`` (3, 3), ``translation`` (3,)."""
    x, y, z = x - translation[0], y - translation[1], z - translation[2]
    return (
        rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z,
        rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z,
        rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z,
    )


@leaf
def body_grid(grids, b):  # type: ignore[no-untyped-def]
    """The scalars of body ``b``'s grid for :func:`look_up`."""
    return (
        grids.offset[b],
        grids.origin_m[b, 0],
        grids.origin_m[b, 1],
        grids.origin_m[b, 2],
        grids.shape[b, 0],
        grids.shape[b, 1],
        grids.shape[b, 2],
        1.0 / grids.spacing_m,
    )


@leaf
def look_up(distance, grid, x, y, z):  # type: ignore[no-untyped-def]
    """Lower bound in metres of the signed distance of a point in the body's joint frame; ``FAR`` beyond the grid.

    ``distance``: :attr:`BodyGrids.distance`; ``grid``: :func:`body_grid` of the body.
    """
    fx, fy, fz = (x - grid[1]) * grid[7], (y - grid[2]) * grid[7], (z - grid[3]) * grid[7]
    if not (0.0 <= fx < grid[4] and 0.0 <= fy < grid[5] and 0.0 <= fz < grid[6]):
        return FAR
    return distance[grid[0] + (int(fx) * grid[5] + int(fy)) * grid[6] + int(fz)] * TENTH_MM


@leaf
def look_near(distance, grid, x, y, z):  # type: ignore[no-untyped-def]
    """:func:`look_up`, closer: a voxel's bound is its centre's distance less half its diagonal; here less only the way to the centre."""
    fx, fy, fz = (x - grid[1]) * grid[7], (y - grid[2]) * grid[7], (z - grid[3]) * grid[7]
    if not (0.0 <= fx < grid[4] and 0.0 <= fy < grid[5] and 0.0 <= fz < grid[6]):
        return FAR
    ix, iy, iz = int(fx), int(fy), int(fz)
    dx, dy, dz = fx - ix - 0.5, fy - iy - 0.5, fz - iz - 0.5
    bound = distance[grid[0] + (ix * grid[5] + iy) * grid[6] + iz] * TENTH_MM
    return bound + (HALF_DIAGONAL - math.sqrt(dx * dx + dy * dy + dz * dz)) / grid[7]


@leaf
def look_close(distance, grid, x, y, z, low_m, high_m):  # type: ignore[no-untyped-def]
    """:func:`look_near`, closer still where that leaves open whether the distance is below ``low_m`` or above ``high_m``.

    A distance changes by at most the way gone, so the centre of any voxel bounds it: by its own distance less the way to it. From one that
    lies ``OUT_M`` farther out, straight away from the body, that is exact but for how far it lies beside the straight way, squared.
    Measured on the bodies of a UR3, voxels of 5 mm, up to 3.5 cm from them: 0.3 mm below the truth on average, :func:`look_near` 2.4.
    """
    fx, fy, fz = (x - grid[1]) * grid[7], (y - grid[2]) * grid[7], (z - grid[3]) * grid[7]
    if not (0.0 <= fx < grid[4] and 0.0 <= fy < grid[5] and 0.0 <= fz < grid[6]):
        return FAR
    ix, iy, iz = int(fx), int(fy), int(fz)
    side_x, side_y = grid[5] * grid[6], grid[6]
    at = grid[0] + ix * side_x + iy * side_y + iz
    dx, dy, dz = fx - ix - 0.5, fy - iy - 0.5, fz - iz - 0.5
    off = math.sqrt(dx * dx + dy * dy + dz * dz)
    bound = distance[at] * TENTH_MM + (HALF_DIAGONAL - off) / grid[7]
    if bound > high_m or bound + 2.0 * off / grid[7] + SLACK_M < low_m:
        return bound
    if not (0 < ix < grid[4] - 1 and 0 < iy < grid[5] - 1 and 0 < iz < grid[6] - 1):
        return bound
    gx = float(distance[at + side_x]) - float(distance[at - side_x])
    gy = float(distance[at + side_y]) - float(distance[at - side_y])
    gz = float(distance[at + 1]) - float(distance[at - 1])
    slope = math.sqrt(gx * gx + gy * gy + gz * gz)
    if slope == 0.0:
        return bound
    step = OUT_M * grid[7] / slope
    ox, oy, oz = fx + step * gx, fy + step * gy, fz + step * gz
    if not (0.0 <= ox < grid[4] and 0.0 <= oy < grid[5] and 0.0 <= oz < grid[6]):
        return bound
    ix, iy, iz = int(ox), int(oy), int(oz)
    dx, dy, dz = ix + 0.5 - fx, iy + 0.5 - fy, iz + 0.5 - fz
    off = math.sqrt(dx * dx + dy * dy + dz * dz)
    return max(bound, distance[grid[0] + ix * side_x + iy * side_y + iz] * TENTH_MM - SLACK_M + (HALF_DIAGONAL - off) / grid[7])


@leaf
def body_distance(grids, b, x, y, z):  # type: ignore[no-untyped-def]
    """:func:`look_up` for a single point; in loops use that."""
    return look_up(grids.distance, body_grid(grids, b), x, y, z)
