"""True depth images of the cell: Open3D rays for the arm's meshes, exact solids for everything else, the nearest of all taken.

One ray-casting scene per link is built once; per frame the rays are moved into the link's frame instead of the mesh into the world, and
only those in the pixel box that the link can appear in. What never moves is drawn once per camera. Rays have z = 1 in the camera's frame,
so the hit parameter is the depth. Measured for four cameras of 424x240 on one shared core: 7 to 8 ms, of which Open3D 5 ms.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import open3d as o3d
from numpy.typing import NDArray

from common.cell import SolidConfig
from common.geometry.transforms import invert, rpy_matrix
from common.robot.solids import Body
from services.robot_sim.core.camera_kernels import fill_rays, keep_nearer
from services.robot_sim.core.camera_model import CameraModel, PixelBox
from services.robot_sim.core.camera_shapes import PlacedShape, cast

__all__ = ["DepthRenderer"]

F64 = NDArray[np.float64]
F32 = NDArray[np.float32]
THREADS = 1  # five processes share two cores


@dataclass(frozen=True, eq=False)
class _Link:
    joint: int
    corners_m: F64  # (8, 3) bounding box in the joint's frame
    scene: o3d.t.geometry.RaycastingScene


class DepthRenderer:
    """Renders a fixed set of cameras.

    Args:
        cameras: all of them, in the order of the images.
        bodies: the arm's bodies in their joints' frames.
        T_world_base: (4, 4) frame 0 of the arm.
        solids: what is bolted down.
    """

    def __init__(self, cameras: Sequence[CameraModel], bodies: Sequence[Body], T_world_base: F64, solids: Sequence[SolidConfig]) -> None:
        self._cameras = list(cameras)
        self._directions = [camera.directions() for camera in self._cameras]
        self._rays = np.empty((sum(c.width * c.height for c in self._cameras), 6), dtype=np.float32)
        links = [_link(body) for body in bodies]
        self._moving = [link for link in links if link.joint > 0]
        self._held: list[_Link] = []
        self._background = [np.full((c.height, c.width), np.inf, dtype=np.float32) for c in self._cameras]
        fixed = [PlacedShape(s.shape, tuple(s.size_m), rpy_matrix(s.position_m, s.rpy_rad)) for s in solids]
        self._draw_shapes(fixed, self._background)
        for link in links:
            if link.joint == 0:
                self._draw_link(link, T_world_base, self._background)

    def hold(self, body: Body | None) -> None:
        """The gripper holds a body from now on, or nothing."""
        self._held = [] if body is None else [_link(body)]

    def render(self, T_world_joint: F64, shapes: Sequence[PlacedShape]) -> list[F32]:
        """True depth (height, width) in metres of each camera, inf where nothing is.

        Args:
            T_world_joint: (J + 1, 4, 4) frames of the arm, 0 = base.
            shapes: everything else that is there now.
        """
        images = [background.copy() for background in self._background]
        for link in self._moving + self._held:
            self._draw_link(link, T_world_joint[link.joint], images)
        self._draw_shapes(shapes, images)
        return images

    def _draw_shapes(self, shapes: Sequence[PlacedShape], images: list[F32]) -> None:
        for shape in shapes:
            for camera, directions, image in zip(self._cameras, self._directions, images, strict=True):
                cast(shape, camera, directions, image)

    def _draw_link(self, link: _Link, T_world_link: F64, images: list[F32]) -> None:
        """One call for the rays of all cameras: a call costs more than a thousand rays."""
        corners = link.corners_m @ T_world_link[:3, :3].T + T_world_link[:3, 3]
        T_link_world = invert(T_world_link)
        end = 0
        boxes: list[PixelBox | None] = []
        for camera, directions in zip(self._cameras, self._directions, strict=True):
            box = camera.pixel_box(corners)
            boxes.append(box)
            if box is not None:
                T = T_link_world @ camera.T_world_camera
                end = fill_rays(np.ascontiguousarray(T[:3, :3]), np.ascontiguousarray(T[:3, 3]), directions, *box, self._rays, end)
        if end == 0:
            return
        t_hit = link.scene.cast_rays(o3d.core.Tensor.from_numpy(self._rays[:end]), nthreads=THREADS)["t_hit"].numpy()
        start = 0
        for box, image in zip(boxes, images, strict=True):
            if box is not None:
                start = keep_nearer(t_hit, start, *box, image)


def _link(body: Body) -> _Link:
    scene = o3d.t.geometry.RaycastingScene(nthreads=THREADS)
    scene.add_triangles(
        o3d.core.Tensor.from_numpy(np.ascontiguousarray(body.vertices, dtype=np.float32)),
        o3d.core.Tensor.from_numpy(np.ascontiguousarray(body.triangles, dtype=np.uint32)),
    )
    low, high = body.vertices.min(axis=0), body.vertices.max(axis=0)
    signs = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=np.float64)
    return _Link(body.joint, low + signs * (high - low), scene)
