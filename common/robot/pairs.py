"""Which bodies of an arm can touch one another at all."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import coal
import numpy as np
from numpy.typing import NDArray

from common.robot.body_distance import pair_distance
from common.robot.kernels import FAR, BodyGrids, Chain, forward_kinematics
from common.robot.solids import Body

__all__ = ["coal_mesh", "self_collision_pairs"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

SAMPLES = 3000  # our choice: for bodies two joints apart that is a sample every 7 degrees of both
NEAR_M = 0.005  # a pair that never came nearer than this in any sample is taken to never touch; our choice
SEED = 20220707


def self_collision_pairs(bodies: Sequence[Body], chain: Chain, grids: BodyGrids, low: F64, high: F64) -> tuple[I64, F64]:
    """(P, 2) pairs of body indices worth checking, and (P,) the distance in metres that each usually has (the median, by the spheres).

    Left out: bodies on the same or on neighbouring frames (joined by construction), pairs that touch in every sampled configuration
    (an artefact of the meshes), and pairs that never come near one another: the exact meshes say so (coal), wherever the conservative
    spheres cannot rule it out. No SRDF for the arms at hand lists the right ones.

    Args:
        bodies, chain, grids: the arm.
        low, high: (J,) joint limits to sample in.
    """
    candidates = [(a, b) for a, b in combinations(range(len(bodies)), 2) if abs(bodies[a].joint - bodies[b].joint) > 1]
    meshes = [coal_mesh(body) for body in bodies]
    request = coal.CollisionRequest()
    request.security_margin = NEAR_M
    rng = np.random.default_rng(SEED)
    n_joints = len(low)
    rotation, translation = np.empty((n_joints + 1, 3, 3)), np.empty((n_joints + 1, 3))
    touches = np.zeros(len(candidates), dtype=np.int64)
    apart = np.empty((SAMPLES, len(candidates)))
    for k, q in enumerate(rng.uniform(low, high, size=(SAMPLES, n_joints))):
        forward_kinematics(chain, q, rotation, translation)
        poses = [coal.Transform3s(rotation[j].copy(), translation[j].copy()) for j in range(n_joints + 1)]
        for i, (a, b) in enumerate(candidates):
            apart[k, i] = pair_distance(grids, a, b, rotation, translation, FAR / 2.0)
            if apart[k, i] > NEAR_M:
                continue
            result = coal.CollisionResult()
            coal.collide(meshes[a], poses[bodies[a].joint], meshes[b], poses[bodies[b].joint], request, result)
            touches[i] += result.isCollision()
    keep = np.flatnonzero((touches > 0) & (touches < SAMPLES))
    return np.array(candidates, dtype=np.int64).reshape(-1, 2)[keep], np.median(apart[:, keep], axis=0)


def coal_mesh(body: Body) -> coal.BVHModelOBBRSS:
    """A body as coal's exact mesh, in the frame of its joint."""
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(body.triangles), len(body.vertices))
    mesh.addVertices(body.vertices)
    for a, b, c in body.triangles:
        mesh.addTriangle(body.vertices[a], body.vertices[b], body.vertices[c])
    mesh.endModel()
    return mesh
