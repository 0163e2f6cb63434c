"""The arm at the instant of an exposure, for the self-filter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from common.robot.kernels import FAR, BodyGrids, Chain, forward_kinematics

__all__ = ["ArmState", "arm_at", "margins_of"]

F64 = NDArray[np.float64]
LARGEST_DISTANCE_M = FAR  # beyond, a body's grid cannot tell: a point farther from the arm is never the arm


class ArmState(NamedTuple):
    """B bodies in their places, for kernels."""

    bodies: F64  # (B, 17): world bounding sphere (centre, radius), margin, rotation world <- joint frame by rows, translation
    sigmas: float


def margins_of(names: Sequence[str], default_m: float, special_m: Mapping[str, float]) -> F64 | str:
    """(B,) margin of each body, or which name of ``special_m`` is no body."""
    unknown = sorted(set(special_m) - set(names))
    if unknown:
        return f"{unknown} are no bodies of this arm: {list(names)}"
    return np.array([special_m.get(name, default_m) for name in names])


def arm_at(chain: Chain, grids: BodyGrids, q_rad: F64, margin_m: F64, sigmas: float) -> ArmState:
    """The arm at joint vector ``q_rad`` (J,); what is nearer to a body than ``margin_m`` (B,) and range noise is the body."""
    n = len(q_rad) + 1
    rotation, translation = np.empty((n, 3, 3)), np.empty((n, 3))
    forward_kinematics(chain, np.ascontiguousarray(q_rad, dtype=np.float64), rotation, translation)
    R, t = rotation[grids.body_joint], translation[grids.body_joint]
    centre = np.einsum("bij,bj->bi", R, grids.bound_centre_m) + t
    radius = grids.bound_radius_m + grids.spacing_m * np.sqrt(3.0)  # a voxel answers for its nearest point: up to a diagonal too little
    return ArmState(np.column_stack([centre, radius, margin_m, R.reshape(-1, 9), t]), sigmas)
