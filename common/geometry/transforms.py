"""Rigid transforms as 4x4 float64 matrices, named ``T_a_b`` (b's coordinates into a's); quaternions are x, y, z, w."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

__all__ = ["invert", "look_at", "pose_matrix", "quaternion_of", "rpy_matrix"]

F64 = NDArray[np.float64]


def pose_matrix(position_m: Sequence[float] | F64, quaternion_xyzw: Sequence[float] | F64) -> F64:
    """4x4 of position and quaternion (normalised here).

    Raises:
        ValueError: zero quaternion.
    """
    T = np.eye(4)
    T[:3, :3] = Rotation.from_quat(np.asarray(quaternion_xyzw, dtype=np.float64)).as_matrix()
    T[:3, 3] = position_m
    return T


def rpy_matrix(position_m: Sequence[float] | F64, rpy_rad: Sequence[float] | F64) -> F64:
    """4x4 of position and fixed-axis roll, pitch, yaw (URDF's convention)."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("xyz", np.asarray(rpy_rad, dtype=np.float64)).as_matrix()
    T[:3, 3] = position_m
    return T


def quaternion_of(T: F64) -> F64:
    """Quaternion x, y, z, w of a 4x4 (or of 3x3)."""
    return np.asarray(Rotation.from_matrix(T[:3, :3]).as_quat(), dtype=np.float64)


def invert(T: F64) -> F64:
    """Inverse of a rigid transform."""
    out = np.eye(4)
    out[:3, :3] = T[:3, :3].T
    out[:3, 3] = -T[:3, :3].T @ T[:3, 3]
    return out


def look_at(eye_m: Sequence[float], target_m: Sequence[float]) -> F64:
    """``T_world_camera`` of a camera at ``eye_m`` that looks at ``target_m``: z forward, x right, y down (optical frame).

    Raises:
        ValueError: eye and target coincide or look straight along world z.
    """
    eye = np.asarray(eye_m, dtype=np.float64)
    z = np.asarray(target_m, dtype=np.float64) - eye
    x = np.cross(z, [0.0, 0.0, 1.0])
    if np.linalg.norm(z) < 1e-9 or np.linalg.norm(x) < 1e-9:
        raise ValueError(f"no view direction from {list(eye_m)} to {list(target_m)}")
    z /= np.linalg.norm(z)
    x /= np.linalg.norm(x)
    T = np.eye(4)
    T[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    T[:3, 3] = eye
    return T
