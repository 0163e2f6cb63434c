"""The solids of a scene as the cameras see them: boxes, spheres, cylinders and capsules, hit by rays exactly (no meshes)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from common.geometry.transforms import invert
from services.robot_sim.core.camera_kernels import BOX, CAPSULE, CYLINDER, SPHERE, cast_shape
from services.robot_sim.core.camera_model import CameraModel

__all__ = ["SHAPES", "PlacedShape", "cast"]

F64 = NDArray[np.float64]
F32 = NDArray[np.float32]
ShapeName = Literal["box", "sphere", "cylinder", "capsule"]
SHAPES: dict[str, tuple[int, int]] = {"box": (BOX, 3), "sphere": (SPHERE, 1), "cylinder": (CYLINDER, 2), "capsule": (CAPSULE, 2)}


@dataclass(frozen=True, eq=False)
class PlacedShape:
    """A solid somewhere.

    Attributes:
        shape: key of :data:`SHAPES`.
        size_m: box 3 full extents; sphere (radius,); cylinder (radius, length along z); capsule (radius, length of its straight part along
            z: the whole is longer by two radii, as in PyBullet).
        T_world_shape: (4, 4).
    """

    shape: ShapeName
    size_m: tuple[float, ...]
    T_world_shape: F64

    def corners_world(self) -> F64:
        """(8, 3) corners of a box that contains the solid."""
        if self.shape == "box":
            half = np.asarray(self.size_m) / 2.0
        elif self.shape == "sphere":
            half = np.full(3, self.size_m[0])
        else:
            radius, length = self.size_m
            half = np.array([radius, radius, length / 2.0 + (radius if self.shape == "capsule" else 0.0)])
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64)
        return np.asarray(signs * half @ self.T_world_shape[:3, :3].T + self.T_world_shape[:3, 3])


def cast(shape: PlacedShape, camera: CameraModel, directions: F32, depth_m: F32) -> None:
    """Lower ``depth_m`` (height, width) to the depth of ``shape`` wherever it is nearer; ``directions`` as of the camera."""
    box = camera.pixel_box(shape.corners_world())
    if box is None:
        return
    kind, _ = SHAPES[shape.shape]
    size = np.zeros(3)
    size[: len(shape.size_m)] = shape.size_m
    T = invert(shape.T_world_shape) @ camera.T_world_camera
    cast_shape(kind, size, np.ascontiguousarray(T[:3, :3]), np.ascontiguousarray(T[:3, 3]), directions, *box, depth_m)
