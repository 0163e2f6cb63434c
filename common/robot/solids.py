"""Rigid bodies as solids: triangle meshes, their signed distance grids and sphere covers.

One sampling serves all: the lookup table, the exact path check and the self-filter read the distance grid of a body; checks against
exact shapes and of the arm against itself use its spheres. Both are conservative: a grid voxel stores the smallest distance that
any of its points can have, and the spheres together contain the whole surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import igl
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from common.cell import SolidConfig
from common.geometry.transforms import rpy_matrix
from common.robot.kernels import FAR, SLACK_M, TENTH_MM, BodyGrids

__all__ = ["GRID_REACH_M", "Body", "box_mesh", "build_grids", "cylinder_mesh", "mesh_of_solid", "sphere_mesh"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]

COVER_VOXEL_M = 0.005  # of the grids that spheres are chosen in: finer ones find the way into hollow meshes; our choice
NEAR_M = 0.025  # finer grids are exact so far from the surface: a 2 cm cell's half diagonal and more; our choice
BLOCK_VOXELS = 4  # along an edge, of the blocks by which they know what is farther; our choice
GRID_REACH_M = FAR + 0.005  # what lies beyond the grid is farther than FAR even after rounding down
SPHERE_OVERSHOOT_M = 0.008  # how far a cover sphere may stick out of the body; our choice
SPHERE_RADIUS_MAX_M = 0.045  # so that a sphere's centre near another body still lies in that body's grid
SPHERES_A_GROUP = 12  # our choice
PART_RADIUS_MAX_M = 0.07  # of the spheres that contain a body; our choice: a link is about twice that long and half as thick
COVER_CANDIDATES = 1500
SAMPLE_GAP_M = 0.0025  # our choice
SAMPLES_AT_ONCE = 10_000  # whose distances are held; all at once took 11 GB for a UR10, whose meshes have long triangles; our choice
CURVE_SEGMENTS = 32


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid part of the arm.

    Attributes:
        name: link name of the URDF, or ``tool``.
        joint: index of the frame that carries it: 0 = base, j = moves with joint j.
        vertices: (V, 3) metres in that frame.
        triangles: (F, 3) vertex indices.
        immobile: never moves and is not checked against the world (it stands in it).
    """

    name: str
    joint: int
    vertices: F64
    triangles: I32
    immobile: bool


def box_mesh(size_m: F64 | list[float]) -> tuple[F64, I32]:
    """Vertices (8, 3) and outward triangles (12, 3) of a box of full extents ``size_m`` around the origin."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64) * np.asarray(size_m) / 2.0
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return corners, np.array(triangles, dtype=np.int32)


def cylinder_mesh(radius_m: float, length_m: float) -> tuple[F64, I32]:
    """A closed cylinder along z around the origin; its polygon contains the true circle."""
    outer = radius_m / np.cos(np.pi / CURVE_SEGMENTS)
    angle = 2.0 * np.pi * np.arange(CURVE_SEGMENTS) / CURVE_SEGMENTS
    ring = np.stack([outer * np.cos(angle), outer * np.sin(angle)], axis=1)
    low = np.column_stack([ring, np.full(CURVE_SEGMENTS, -length_m / 2)])
    high = np.column_stack([ring, np.full(CURVE_SEGMENTS, length_m / 2)])
    vertices = np.vstack([low, high, [[0, 0, -length_m / 2], [0, 0, length_m / 2]]])
    n = CURVE_SEGMENTS
    triangles = []
    for i in range(n):
        j = (i + 1) % n
        triangles += [(i, j, n + j), (i, n + j, n + i), (2 * n, j, i), (2 * n + 1, n + i, n + j)]
    return vertices, np.array(triangles, dtype=np.int32)


def sphere_mesh(radius_m: float) -> tuple[F64, I32]:
    """A closed sphere around the origin as a latitude-longitude mesh that contains the true sphere."""
    rows, columns = CURVE_SEGMENTS // 2, CURVE_SEGMENTS
    outer = radius_m / np.cos(np.pi / CURVE_SEGMENTS) ** 2
    polar = np.pi * np.arange(1, rows) / rows
    azimuth = 2.0 * np.pi * np.arange(columns) / columns
    grid = np.stack(
        [np.outer(np.sin(polar), np.cos(azimuth)), np.outer(np.sin(polar), np.sin(azimuth)), np.repeat(np.cos(polar)[:, None], columns, 1)],
        -1,
    ).reshape(-1, 3)
    vertices = outer * np.vstack([grid, [[0, 0, 1], [0, 0, -1]]])
    top, bottom = len(grid), len(grid) + 1
    triangles = []
    for c in range(columns):
        d = (c + 1) % columns
        triangles += [(top, c, d), (bottom, (rows - 2) * columns + d, (rows - 2) * columns + c)]
        for r in range(rows - 2):
            a, b, e, f = r * columns + c, r * columns + d, (r + 1) * columns + d, (r + 1) * columns + c
            triangles += [(a, f, e), (a, e, b)]
    return vertices, np.array(triangles, dtype=np.int32)


def mesh_of_solid(solid: SolidConfig) -> tuple[F64, I32]:
    """Triangle mesh of a configured solid, placed by its pose."""
    if solid.shape == "box":
        vertices, triangles = box_mesh(solid.size_m)
    elif solid.shape == "cylinder":
        vertices, triangles = cylinder_mesh(solid.size_m[0], solid.size_m[1])
    else:
        vertices, triangles = sphere_mesh(solid.size_m[0])
    T = rpy_matrix(solid.position_m, solid.rpy_rad)
    return vertices @ T[:3, :3].T + T[:3, 3], triangles


def build_grids(bodies: tuple[Body, ...], voxel_m: float) -> BodyGrids:
    """Distance grids, of voxels with edges of ``voxel_m``, and sphere covers of all bodies.

    Takes about 10 s for a UR3 and voxels of 5 mm (libigl), hence cached by the caller.
    """
    origins, shapes, distances, spheres, groups, parts = [], [], [], [], [], []
    for body in bodies:
        origin, signed = _signed_distances(body, COVER_VOXEL_M)
        low, near = (origin, signed) if voxel_m == COVER_VOXEL_M else _near_distances(body, voxel_m)
        lower_bound = near - voxel_m * np.sqrt(3.0) / 2.0  # a signed distance changes by at most the way gone
        stored = np.floor(np.clip(lower_bound, -3.0, 3.0) / TENTH_MM)
        origins.append(low)
        shapes.append(near.shape)
        distances.append(stored.astype(np.int16).ravel())
        ordered, group = _grouped(_sphere_cover(body, origin, signed))
        parts.append(_parts(body, origin, signed))
        spheres.append(ordered)
        groups.append(group)
    boxes = [(b.vertices.min(axis=0), b.vertices.max(axis=0)) for b in bodies]
    centres = [(low + high) / 2.0 for low, high in boxes]
    radii = [float(np.linalg.norm(b.vertices - c, axis=1).max()) for b, c in zip(bodies, centres, strict=True)]
    return BodyGrids(
        body_joint=np.array([b.joint for b in bodies], dtype=np.int64),
        spacing_m=voxel_m,
        origin_m=np.array(origins),
        shape=np.array(shapes, dtype=np.int64),
        offset=_offsets([len(d) for d in distances]),
        distance=np.concatenate(distances),
        box_min_m=np.array([low for low, _ in boxes]),
        box_max_m=np.array([high for _, high in boxes]),
        bound_centre_m=np.array(centres),
        bound_radius_m=np.array(radii),
        part_m=np.concatenate(parts),
        part_offset=_offsets([len(p) for p in parts]),
        spheres_m=np.concatenate(spheres),
        group_m=np.concatenate([g[:, :4] for g in groups]),
        group_sphere_offset=_offsets(np.concatenate([g[:, 4] for g in groups])),
        group_offset=_offsets([len(g) for g in groups]),
    )


def _offsets(counts: Sequence[int] | F64) -> NDArray[np.int64]:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)


def _grouped(spheres: F64) -> tuple[F64, F64]:
    """Spheres in an order in which neighbours stand together, and (G, 5) groups of them: bounding sphere x, y, z, radius and count."""
    if len(spheres) <= SPHERES_A_GROUP:
        centre = (spheres[:, :3].min(axis=0) + spheres[:, :3].max(axis=0)) / 2.0
        radius = (np.linalg.norm(spheres[:, :3] - centre, axis=1) + spheres[:, 3]).max()
        return spheres, np.array([[*centre, radius, len(spheres)]])
    axis = int(np.argmax(np.ptp(spheres[:, :3], axis=0)))
    order = np.argsort(spheres[:, axis], kind="stable")
    halves = [_grouped(spheres[part]) for part in np.array_split(order, 2)]
    return np.vstack([h[0] for h in halves]), np.vstack([h[1] for h in halves])


def _parts(body: Body, origin: F64, signed: F64) -> F64:
    """(Q, 4) spheres that contain all of a body, inner voxels and surface; halved across the longest extent until they are small."""
    points = np.vstack([_centres(origin, np.argwhere(_filled(signed))), _surface_samples(body)])
    return _halved(points, SAMPLE_GAP_M + COVER_VOXEL_M * np.sqrt(3.0) / 2.0)


def _halved(points: F64, room: float) -> F64:
    centre = (points.min(axis=0) + points.max(axis=0)) / 2.0
    radius = float(np.linalg.norm(points - centre, axis=1).max()) + room
    extent = np.ptp(points, axis=0)
    axis = int(np.argmax(extent))
    if radius <= PART_RADIUS_MAX_M or extent[axis] < PART_RADIUS_MAX_M:
        return np.array([[*centre, radius]])
    low = points[:, axis] <= centre[axis]
    return np.vstack([_halved(points[low], room), _halved(points[~low], room)])


def _signed_distances(body: Body, voxel_m: float) -> tuple[F64, F64]:
    """Grid origin (3,) and signed distances (nx, ny, nz) at the voxel centres of a body's grid."""
    low, shape = _box_of_grid(body, voxel_m)
    return low, _signed(body, _centres(low, np.argwhere(np.ones(shape, dtype=bool)), voxel_m)).reshape(shape)


def _near_distances(body: Body, voxel_m: float) -> tuple[F64, F64]:
    """:func:`_signed_distances`, but only lower bounds of them beyond ``NEAR_M`` of the surface: from the middle of a block of voxels."""
    low, shape = _box_of_grid(body, voxel_m)
    blocks = tuple(-(-n // BLOCK_VOXELS) for n in shape)
    middles = _centres(low, np.argwhere(np.ones(blocks, dtype=bool)), BLOCK_VOXELS * voxel_m)
    within = (np.argwhere(np.ones((BLOCK_VOXELS,) * 3, dtype=bool)) - (BLOCK_VOXELS - 1) / 2.0) * voxel_m
    away = np.linalg.norm(within, axis=1)
    middle = _signed(body, middles)
    signed = middle[:, None] - away - SLACK_M  # a signed distance changes by at most the way gone
    near = np.abs(middle) < NEAR_M + away.max()
    signed[near] = _signed(body, (middles[near, None] + within).reshape(-1, 3)).reshape(-1, len(within))
    by_axis = signed.reshape(*blocks, BLOCK_VOXELS, BLOCK_VOXELS, BLOCK_VOXELS).transpose(0, 3, 1, 4, 2, 5)
    whole = by_axis.reshape([n * BLOCK_VOXELS for n in blocks])
    return low, np.ascontiguousarray(whole[: shape[0], : shape[1], : shape[2]])


def _box_of_grid(body: Body, voxel_m: float) -> tuple[F64, tuple[int, ...]]:
    """Lowest corner (3,) of a body's grid, and its shape."""
    low = body.vertices.min(axis=0) - GRID_REACH_M
    high = body.vertices.max(axis=0) + GRID_REACH_M
    return low, tuple(int(n) for n in np.ceil((high - low) / voxel_m))


def _signed(body: Body, points_m: F64) -> F64:
    """Signed distances (n,) of points (n, 3) in the body's joint frame."""
    signed = igl.signed_distance(
        points_m,
        np.ascontiguousarray(body.vertices),
        np.ascontiguousarray(body.triangles, dtype=np.int64),
        sign_type=igl.SIGNED_DISTANCE_TYPE_FAST_WINDING_NUMBER,
    )[0]
    return np.asarray(signed, dtype=np.float64)


def _sphere_cover(body: Body, origin: F64, signed: F64) -> F64:
    """(S, 4) spheres that contain the body's surface and stick out by at most ``SPHERE_OVERSHOOT_M``.

    Greedy set cover: centres are inner voxels, radius = depth + overshoot; it must hold each sample of the outer surface together with
    the gap around it. What no candidate covers (thin parts) gets a small sphere of its own.
    """
    inside = _filled(signed)
    surface = _surface_samples(body)
    surface = surface[cKDTree(_centres(origin, np.argwhere(~inside))).query(surface)[0] <= COVER_VOXEL_M * np.sqrt(3.0)]
    centres = _centres(origin, np.argwhere(inside))
    depth = cKDTree(surface).query(centres)[0]
    order = np.argsort(-depth, kind="stable")[:: max(1, len(depth) // COVER_CANDIDATES)]
    centres, depth = centres[order], depth[order]
    radii = np.minimum(depth + SPHERE_OVERSHOOT_M, SPHERE_RADIUS_MAX_M)
    covered_by = np.empty((len(surface), len(centres)), dtype=bool)
    for k in range(0, len(surface), SAMPLES_AT_ONCE):
        covered_by[k : k + SAMPLES_AT_ONCE] = cdist(surface[k : k + SAMPLES_AT_ONCE], centres) + SAMPLE_GAP_M <= radii
    gain = covered_by.sum(axis=0)
    uncovered = np.ones(len(surface), dtype=bool)
    chosen: list[F64] = []
    while uncovered.any():
        best = int(np.argmax(gain)) if len(gain) else 0
        if len(gain) and gain[best] > 0:
            chosen.append(np.array([*centres[best], radii[best]]))
            newly = covered_by[:, best] & uncovered
        else:
            centre = surface[np.flatnonzero(uncovered)[0]]
            chosen.append(np.array([*centre, SPHERE_OVERSHOOT_M]))
            newly = uncovered & (np.linalg.norm(surface - centre, axis=1) + SAMPLE_GAP_M <= SPHERE_OVERSHOOT_M)
        gain = gain - covered_by[newly].sum(axis=0)
        uncovered &= ~newly
        if 2 * np.count_nonzero(uncovered) < len(uncovered):  # what is covered is looked at no more
            surface, covered_by, uncovered = surface[uncovered], covered_by[uncovered], uncovered[uncovered]
    return np.array(chosen)


def _centres(origin: F64, ijk: NDArray[np.intp], voxel_m: float = COVER_VOXEL_M) -> F64:
    return origin + (ijk + 0.5) * voxel_m


def _filled(signed: F64) -> NDArray[np.bool_]:
    """Voxels that cannot be reached from outside: the material and the cavities within it (collision meshes are often hollow)."""
    regions, _ = ndimage.label(signed > 0.0)
    return np.asarray(regions != regions[0, 0, 0])


def _surface_samples(body: Body) -> F64:
    """Points on the body's triangles such that no point of the surface is farther than ``SAMPLE_GAP_M`` from one of them."""
    corners = body.vertices[body.triangles]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    side = SAMPLE_GAP_M * np.sqrt(3.0)  # a triangle of this side has all its points within the gap of a corner
    pieces = np.ceil(longest / side).astype(int)
    points = [body.vertices]
    for n in np.unique(pieces[pieces > 1]):
        weights = np.array([(i, j, n - i - j) for i in range(n + 1) for j in range(n + 1 - i)], dtype=np.float64) / n
        points.append(np.einsum("wk,tkx->twx", weights, corners[pieces == n]).reshape(-1, 3))
    return np.unique(np.vstack(points), axis=0)
