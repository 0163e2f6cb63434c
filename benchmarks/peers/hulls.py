"""A body as convex pieces: never smaller than its mesh, and much faster to check."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from common.robot.solids import Body

__all__ = ["Piece", "convex_pieces"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
Piece = tuple[F64, I32]

SLABS = 3  # two ends and a tube: what a long link is made of
WORTH = 0.9  # cut only what loses a tenth of its hull by it: upper arm and forearm of a UR3; our choice


def convex_pieces(body: Body) -> list[Piece]:
    """Convex hulls that together contain the mesh: vertices (V, 3) in metres in the joint's frame, outward triangles (F, 3).

    One hull a link would be the usual choice. The two long links of a UR are tubes with thick ends, though: with one hull each, 4 of
    100 questions of the set ``task`` begin or end inside a hull that the mesh does not fill. Cut into three across their longest axis
    none does, free poses are as many as with the bare meshes (0.460 against 0.462 of random ones; one hull: 0.447), and a check takes
    15 us instead of 14 us (meshes: 42 to 58 us). All measured.
    """
    whole = [_hull(body.vertices)]
    pieces = [_hull(points) for points in _slabs(body)]
    return pieces if _volume(pieces) < WORTH * _volume(whole) else whole


def _slabs(body: Body) -> list[F64]:
    """Points of the mesh's surface in each of ``SLABS`` equal slabs, with those where its edges cross the planes between."""
    axis = int(np.argmax(np.ptp(body.vertices, axis=0)))
    along = body.vertices[:, axis]
    planes = np.linspace(along.min(), along.max(), SLABS + 1)
    edges = np.unique(np.sort(body.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    slabs = []
    for low, high in pairwise(planes):
        inside = body.vertices[(along >= low) & (along <= high)]
        slabs.append(np.vstack([inside, *(_crossings(body.vertices, edges, axis, plane) for plane in (low, high))]))
    return slabs


def _crossings(vertices: F64, edges: I32, axis: int, plane_m: float) -> F64:
    a, b = vertices[edges[:, 0]], vertices[edges[:, 1]]
    crosses = (a[:, axis] - plane_m) * (b[:, axis] - plane_m) < 0.0
    a, b = a[crosses], b[crosses]
    share = (plane_m - a[:, axis]) / (b[:, axis] - a[:, axis])
    return np.asarray(a + share[:, None] * (b - a))


def _hull(points: F64) -> Piece:
    hull = ConvexHull(points)
    index = np.full(len(points), -1, dtype=np.int32)
    index[hull.vertices] = np.arange(len(hull.vertices))
    triangles = index[hull.simplices]
    vertices = np.ascontiguousarray(points[hull.vertices])
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    inwards = np.einsum("fk,fk->f", np.cross(b - a, c - a), hull.equations[:, :3]) < 0.0
    triangles[inwards] = triangles[inwards][:, ::-1]
    return vertices, triangles


def _volume(pieces: list[Piece]) -> float:
    return float(sum(ConvexHull(vertices).volume for vertices, _ in pieces))
