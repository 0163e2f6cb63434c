"""What is bolted down: exact shapes, and a coarse field of distances that tells at once where none of them is near.

Referees: brute force over every sphere (``tests/unit/planner/test_slack.py``), coal.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from common.kernel import inlined, leaf
from common.robot.body_distance import to_world

__all__ = ["BOX", "CYLINDER", "NO_SOLIDS", "SPHERE", "Field", "Solids", "body_static_gap", "fill_field", "solid_distance"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

BOX, SPHERE, CYLINDER = 0, 1, 2
FINE_M = 0.01  # where the field leaves less room than that, exact distances are asked; our choice
ROOT3 = math.sqrt(3.0)


class Field(NamedTuple):
    """Lower bounds of the distance to the nearest solid: around the solids by voxels, beyond by their common box."""

    distance_m: NDArray[np.float32]  # flat, x slowest; holds for every point of a voxel
    origin_m: F64  # (3,) lowest corner
    shape: I64  # (3,)
    spacing_m: float
    low_m: F64  # (3,) lowest and highest corner of the box that contains all solids
    high_m: F64


class Solids(NamedTuple):
    """S exact static shapes: ``size_m`` box half extents; sphere [radius]; cylinder [radius, half length along z]."""

    kind: I64  # (S,) BOX, SPHERE, CYLINDER
    size_m: F64  # (S, 3)
    rotation: F64  # (S, 3, 3) world <- solid
    translation: F64  # (S, 3)
    field: Field


_UNKNOWN = Field(np.empty(0, dtype=np.float32), np.zeros(3), np.zeros(3, dtype=np.int64), 1.0, np.zeros(3), np.zeros(3))
NO_SOLIDS = Solids(np.empty(0, dtype=np.int64), np.empty((0, 3)), np.empty((0, 3, 3)), np.empty((0, 3)), _UNKNOWN)


@leaf
def solid_distance(kind, size_m, turn, shift, s, px, py, pz):  # type: ignore[no-untyped-def]
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


@leaf
def fill_field(solids, field):  # type: ignore[no-untyped-def]
    """Fill ``field.distance_m``: the distance at each voxel's centre less half its diagonal."""
    nx, ny, nz = field.shape
    h, origin = field.spacing_m, field.origin_m
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                x, y, z = origin[0] + (i + 0.5) * h, origin[1] + (j + 0.5) * h, origin[2] + (k + 0.5) * h
                nearest = np.inf
                for s in range(len(solids.kind)):
                    nearest = min(nearest, solid_distance(solids.kind, solids.size_m, solids.rotation, solids.translation, s, x, y, z))
                # Single precision rounds by less than a micrometre here.
                field.distance_m[(i * ny + j) * nz + k] = nearest - 0.5 * h * ROOT3 - 1e-6


@leaf
def _field_at(field, x, y, z):  # type: ignore[no-untyped-def]
    """Lower bound at a world point."""
    fx, fy, fz = (
        (x - field.origin_m[0]) / field.spacing_m,
        (y - field.origin_m[1]) / field.spacing_m,
        (z - field.origin_m[2]) / field.spacing_m,
    )
    if not (0.0 <= fx < field.shape[0] and 0.0 <= fy < field.shape[1] and 0.0 <= fz < field.shape[2]):
        u = max(field.low_m[0] - x, x - field.high_m[0], 0.0)
        v = max(field.low_m[1] - y, y - field.high_m[1], 0.0)
        w = max(field.low_m[2] - z, z - field.high_m[2], 0.0)
        return math.sqrt(u * u + v * v + w * w)
    return float(field.distance_m[(int(fx) * field.shape[1] + int(fy)) * field.shape[2] + int(fz)])


@inlined
def body_static_gap(grids, solids, b, turn, shift, margin_m):  # type: ignore[no-untyped-def]
    """``(gap, solid)``: how far body ``b`` may move until it could be within ``margin_m`` of the static layer (a lower bound, in metres).

    Zero or less: it is, of that ``solid``; else -1. ``turn`` (3, 3), ``shift`` (3,): the body's frame.
    """
    if len(solids.kind) == 0:
        return np.inf, -1
    gap = np.inf
    for p in range(grids.part_offset[b], grids.part_offset[b + 1]):
        x, y, z = to_world(turn, shift, grids.part_m, p)
        gap = min(gap, _field_at(solids.field, x, y, z) - grids.part_m[p, 3] - margin_m)
    if gap > FINE_M:
        return gap, -1
    gap = np.inf
    for g in range(grids.group_offset[b], grids.group_offset[b + 1]):
        x, y, z = to_world(turn, shift, grids.group_m, g)
        room = _field_at(solids.field, x, y, z) - grids.group_m[g, 3] - margin_m
        if room > FINE_M:
            gap = min(gap, room)
            continue
        for s in range(len(solids.kind)):
            room = _group_room(grids, solids, g, s, x, y, z, turn, shift, margin_m)
            if room <= 0.0:
                return room, s
            gap = min(gap, room)
    return gap, -1


@leaf
def _group_room(grids, solids, g, s, x, y, z, turn, shift, margin_m):  # type: ignore[no-untyped-def]
    """Room of group ``g``, its middle at (x, y, z), beyond ``margin_m`` of solid ``s``; by its single spheres where that is little."""
    kind, size, rotation, translation = solids.kind, solids.size_m, solids.rotation, solids.translation
    room = solid_distance(kind, size, rotation, translation, s, x, y, z) - grids.group_m[g, 3] - margin_m
    if room > FINE_M:
        return room
    room = np.inf
    for p in range(grids.group_sphere_offset[g], grids.group_sphere_offset[g + 1]):
        x, y, z = to_world(turn, shift, grids.spheres_m, p)
        room = min(room, solid_distance(kind, size, rotation, translation, s, x, y, z) - grids.spheres_m[p, 3] - margin_m)
    return room
