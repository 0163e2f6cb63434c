"""Which bodies of an arm can touch one another at all."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from common.robot.body_distance import pair_distance
from common.robot.kernels import FAR, BodyGrids, Chain, forward_kinematics
from common.robot.solids import SPHERE_RADIUS_MAX_M

__all__ = ["self_collision_pairs"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

SAMPLES = 4000  # our choice: a pair that touches in one configuration of a thousand is missed with probability exp(-4)
NEAR_M = FAR - SPHERE_RADIUS_MAX_M  # a pair that never came nearer than this in all samples is taken to never touch
SEED = 20220707


def self_collision_pairs(chain: Chain, grids: BodyGrids, low: F64, high: F64) -> I64:
    """(P, 2) pairs of body indices worth checking.

    Left out: bodies on the same or on neighbouring frames (joined by construction), pairs that touch in every sampled configuration
    (an artefact of the meshes), and pairs that never come near one another. No SRDF for the arms at hand lists the right ones.

    Args:
        chain, grids: the arm.
        low, high: (J,) joint limits to sample in.
    """
    candidates = [
        (a, b)
        for a, b in combinations(range(len(grids.body_joint)), 2)
        if abs(int(grids.body_joint[a]) - int(grids.body_joint[b])) > 1
    ]
    rng = np.random.default_rng(SEED)
    n_joints = len(low)
    rotation, translation = np.empty((n_joints + 1, 3, 3)), np.empty((n_joints + 1, 3))
    nearest = np.full(len(candidates), np.inf)
    farthest = np.full(len(candidates), -np.inf)
    for q in rng.uniform(low, high, size=(SAMPLES, n_joints)):
        forward_kinematics(chain, q, rotation, translation)
        for i, (a, b) in enumerate(candidates):
            distance = pair_distance(grids, a, b, rotation, translation)
            nearest[i] = min(nearest[i], distance)
            farthest[i] = max(farthest[i], distance)
    keep = [pair for pair, near, far in zip(candidates, nearest, farthest, strict=True) if near < NEAR_M and far > 0.0]
    return np.array(keep, dtype=np.int64).reshape(-1, 2)
