"""Where things truly are: signed distances of placed solids, in numpy, for judging what was seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.geometry.transforms import invert
from services.robot_sim.core.camera_shapes import PlacedShape

F64 = NDArray[np.float64]


def signed_distance_m(shape: PlacedShape, points_m: F64) -> F64:
    """(P,) signed distance (negative inside) of world points (P, 3) to a solid."""
    T = invert(shape.T_world_shape)
    p = points_m @ T[:3, :3].T + T[:3, 3]
    if shape.shape == "sphere":
        return np.linalg.norm(p, axis=1) - shape.size_m[0]
    if shape.shape == "capsule":
        radius, length = shape.size_m
        p[:, 2] -= np.clip(p[:, 2], -length / 2, length / 2)
        return np.linalg.norm(p, axis=1) - radius
    if shape.shape == "cylinder":
        q = np.stack([np.linalg.norm(p[:, :2], axis=1) - shape.size_m[0], np.abs(p[:, 2]) - shape.size_m[1] / 2], axis=1)
    else:
        q = np.abs(p) - np.asarray(shape.size_m) / 2
    return np.linalg.norm(np.maximum(q, 0.0), axis=1) + np.minimum(q.max(axis=1), 0.0)
