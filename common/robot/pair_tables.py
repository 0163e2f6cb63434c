"""How near two bodies of an arm can come that are two joints apart, by the angles of these two joints alone.

Such bodies stay close together by construction (an upper arm beside its base), so that a look at their spheres is asked for at nearly every
pose and seldom says anything. Their relative pose has two parameters: a table answers instead. Where the spheres leave it open, the table
is made from the exact distance of the meshes (coal): spheres that stick out would forbid poses that the arm truly has.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import coal
import numpy as np
from numpy.typing import NDArray

from common.kernel import kernel, leaf
from common.robot.body_distance import to_world
from common.robot.kernels import BodyGrids, Chain, body_grid, forward_kinematics, look_up, to_joint_frame
from common.robot.pairs import coal_mesh
from common.robot.solids import Body

__all__ = ["NO_TABLE", "PairTables", "build_pair_tables", "table_distance"]

I64 = NDArray[np.int64]
N_ANGLES = 360  # one degree a cell: what is lost within it is a millimetre or two; our choice
NO_TABLE = -1
# Where the spheres' bound lies between these, the meshes are asked: above it is enough for any margin, below the bodies touch. Our choice.
UNSURE_M = (-0.025, 0.01)
# A distance beyond this is not looked for more closely: coal leaves out what is farther, a quarter of a UR5's geometry. Our choice.
AMPLE_M = 0.02


class PairTables(NamedTuple):
    """Lower bounds of the distance of the pairs that have a table."""

    table: I64  # (P,) index into distance_m, NO_TABLE where a pair has none
    first_joint: I64  # (P,) the first of the two joints
    distance_m: NDArray[np.float32]  # (T, N_ANGLES, N_ANGLES) holds for every pose of a cell


def build_pair_tables(bodies: Sequence[Body], chain: Chain, grids: BodyGrids, pairs: I64) -> PairTables:
    """Tables of all ``pairs`` (P, 2) whose bodies are two turning joints apart."""
    table, first_joint = np.full(len(pairs), NO_TABLE, dtype=np.int64), np.zeros(len(pairs), dtype=np.int64)
    tables: list[NDArray[np.float32]] = []
    for p, (a, b) in enumerate(pairs):
        near, far = sorted((int(grids.body_joint[a]), int(grids.body_joint[b])))
        if far - near != 2 or chain.prismatic[near:far].any():
            continue
        distance_m = np.empty((N_ANGLES, N_ANGLES), dtype=np.float32)
        motion_m = np.empty((N_ANGLES, N_ANGLES))
        _fill(chain, grids, int(a), int(b), near, distance_m, motion_m)
        _measure(chain, bodies[a], bodies[b], near, distance_m, motion_m)
        table[p], first_joint[p] = len(tables), near
        tables.append(distance_m)
    return PairTables(table, first_joint, np.stack(tables) if tables else np.empty((0, N_ANGLES, N_ANGLES), dtype=np.float32))


def _measure(chain: Chain, a: Body, b: Body, joint: int, distance_m: NDArray[np.float32], motion_m: NDArray[np.float64]) -> None:
    """Raise ``distance_m`` where the spheres are unsure to the meshes' distance at a cell's middle, less ``motion_m`` within it.

    At most to ``AMPLE_M``.
    """
    meshes, request = (coal_mesh(a), coal_mesh(b)), coal.DistanceRequest()
    n_joints = len(chain.axis)
    q, rotation, translation = np.zeros(n_joints), np.empty((n_joints + 1, 3, 3)), np.empty((n_joints + 1, 3))
    for i, k in np.argwhere((distance_m > UNSURE_M[0]) & (distance_m < UNSURE_M[1])):
        q[joint : joint + 2] = (2 * i + 1) * math.pi / N_ANGLES, (2 * k + 1) * math.pi / N_ANGLES
        forward_kinematics(chain, q, rotation, translation)
        placed = [coal.Transform3s(rotation[body.joint].copy(), translation[body.joint].copy()) for body in (a, b)]
        result = coal.DistanceResult()
        result.min_distance = AMPLE_M + motion_m[i, k]
        apart = coal.distance(meshes[0], placed[0], meshes[1], placed[1], request, result)
        distance_m[i, k] = max(distance_m[i, k], apart - motion_m[i, k] - 1e-6)


@leaf
def table_distance(tables, p, q_rad):  # type: ignore[no-untyped-def]
    """Lower bound in metres of the distance of pair ``p``, which has a table, at ``q_rad`` (J,)."""
    j = tables.first_joint[p]
    return tables.distance_m[tables.table[p], _cell(q_rad[j]), _cell(q_rad[j + 1])]


@leaf
def _cell(angle_rad):  # type: ignore[no-untyped-def]
    turns = angle_rad / (2.0 * math.pi)
    return min(int((turns - math.floor(turns)) * N_ANGLES), N_ANGLES - 1)


@kernel
def _fill(chain, grids, a, b, joint, distance_m, motion_m):  # type: ignore[no-untyped-def]
    """Fill ``distance_m``: the distance at each cell's middle less what a body can move relative to the other within the cell.

    ``motion_m``: the farthest that any point of it can.

    A point at r1 and r2 from the two axes moves by at most (r1 + r2 + r2 half) half while both joints turn by ``half``.
    """
    if grids.group_offset[a + 1] - grids.group_offset[a] > grids.group_offset[b + 1] - grids.group_offset[b]:
        a, b = b, a
    n_joints = len(chain.axis)
    q, rotation, translation = np.zeros(n_joints), np.empty((n_joints + 1, 3, 3)), np.empty((n_joints + 1, 3))
    half = math.pi / N_ANGLES
    axes, places = np.empty((2, 3)), np.empty((2, 3))
    for i in range(N_ANGLES):
        for k in range(N_ANGLES):
            q[joint], q[joint + 1] = (2 * i + 1) * half, (2 * k + 1) * half
            forward_kinematics(chain, q, rotation, translation)
            for axis in range(2):
                frame = joint + 1 + axis
                axes[axis] = rotation[frame] @ chain.axis[joint + axis]
                places[axis] = translation[frame]
            distance_m[i, k] = _least(grids, a, b, rotation, translation, axes, places, half) - 1e-6  # what single precision rounds
            motion_m[i, k] = _farthest(grids, a, rotation, translation, axes, places, half)


@leaf
def _least(grids, a, b, rotation, translation, axes, places, half):  # type: ignore[no-untyped-def]
    """Least over the spheres of body ``a`` of their distance to body ``b`` less their motion."""
    ja, jb = grids.body_joint[a], grids.body_joint[b]
    turn_a, shift_a, turn_b, shift_b = rotation[ja], translation[ja], rotation[jb], translation[jb]
    distance, grid = grids.distance, body_grid(grids, b)
    groups, spheres, first = grids.group_m, grids.spheres_m, grids.group_sphere_offset
    best = np.inf
    for g in range(grids.group_offset[a], grids.group_offset[a + 1]):
        if _room(distance, grid, groups, g, turn_a, shift_a, turn_b, shift_b, axes, places, half) >= best:
            continue
        for s in range(first[g], first[g + 1]):
            best = min(best, _room(distance, grid, spheres, s, turn_a, shift_a, turn_b, shift_b, axes, places, half))
    return best


@leaf
def _farthest(grids, a, rotation, translation, axes, places, half):  # type: ignore[no-untyped-def]
    """The most that any sphere of body ``a`` moves."""
    turn, shift = rotation[grids.body_joint[a]], translation[grids.body_joint[a]]
    farthest = 0.0
    for s in range(grids.group_sphere_offset[grids.group_offset[a]], grids.group_sphere_offset[grids.group_offset[a + 1]]):
        x, y, z = to_world(turn, shift, grids.spheres_m, s)
        farthest = max(farthest, _motion(axes, places, x, y, z, grids.spheres_m[s, 3], half))
    return farthest


@leaf
def _motion(axes, places, x, y, z, radius, half):  # type: ignore[no-untyped-def]
    """The most that a point within ``radius`` of (x, y, z) moves; see :func:`_fill`."""
    r1 = _off_axis(axes, places, 0, x, y, z) + radius
    r2 = _off_axis(axes, places, 1, x, y, z) + radius
    return (r1 + r2 + r2 * half) * half


@leaf
def _room(distance, grid, spheres, i, turn_a, shift_a, turn_b, shift_b, axes, places, half):  # type: ignore[no-untyped-def]
    """Distance from sphere ``i`` to the body with ``grid``, less what the sphere's points may move relative to it."""
    x, y, z = to_world(turn_a, shift_a, spheres, i)
    radius = spheres[i, 3]
    bx, by, bz = to_joint_frame(turn_b, shift_b, x, y, z)
    return look_up(distance, grid, bx, by, bz) - radius - _motion(axes, places, x, y, z, radius, half)


@leaf
def _off_axis(axes, places, i, x, y, z):  # type: ignore[no-untyped-def]
    """Distance of a point from an axis: length of the cross product with its unit vector."""
    dx, dy, dz = x - places[i, 0], y - places[i, 1], z - places[i, 2]
    ax, ay, az = axes[i, 0], axes[i, 1], axes[i, 2]
    cx, cy, cz = dy * az - dz * ay, dz * ax - dx * az, dx * ay - dy * ax
    return math.sqrt(cx * cx + cy * cy + cz * cz)
