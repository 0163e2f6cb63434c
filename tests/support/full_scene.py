"""The slow obvious way to a depth image: all meshes placed in one Open3D scene, all rays cast. Oracle of ``adapters/raycast.py``."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import open3d as o3d
from numpy.typing import NDArray

from common.cell import SolidConfig
from common.robot.solids import Body, mesh_of_solid
from services.robot_sim.core.camera_model import CameraModel
from services.robot_sim.core.camera_shapes import PlacedShape

F64 = NDArray[np.float64]
FINE = 200  # segments of a round mesh: its sagitta at 5 cm is 6 um


def mesh_of_shape(shape: PlacedShape) -> list[o3d.geometry.TriangleMesh]:
    make = o3d.geometry.TriangleMesh
    if shape.shape == "box":
        mesh = make.create_box(*shape.size_m)
        mesh.translate(-np.asarray(shape.size_m) / 2)
        meshes = [mesh]
    elif shape.shape == "sphere":
        meshes = [make.create_sphere(shape.size_m[0], FINE)]
    else:
        radius, length = shape.size_m
        meshes = [make.create_cylinder(radius, length, FINE, 1)]
        if shape.shape == "capsule":
            for side in (-1, 1):
                meshes.append(make.create_sphere(radius, FINE).translate([0, 0, side * length / 2]))
    return [m.transform(shape.T_world_shape) for m in meshes]


def full_scene(bodies: Sequence[Body], T_world_joint: F64, solids: Sequence[SolidConfig], shapes: Sequence[PlacedShape]):
    scene = o3d.t.geometry.RaycastingScene()

    def add(vertices: F64, triangles: NDArray[np.int32]) -> None:
        scene.add_triangles(
            o3d.core.Tensor(np.asarray(vertices, dtype=np.float32)), o3d.core.Tensor(np.asarray(triangles, dtype=np.uint32))
        )

    for body in bodies:
        T = T_world_joint[body.joint]
        add(body.vertices @ T[:3, :3].T + T[:3, 3], body.triangles)
    for solid in solids:
        add(*mesh_of_solid(solid))
    for shape in shapes:
        for mesh in mesh_of_shape(shape):
            add(np.asarray(mesh.vertices), np.asarray(mesh.triangles))
    return scene


def depth_of(scene: o3d.t.geometry.RaycastingScene, camera: CameraModel) -> NDArray[np.float32]:
    directions = camera.directions().reshape(-1, 3) @ camera.T_world_camera[:3, :3].T
    rays = np.concatenate([np.broadcast_to(camera.T_world_camera[:3, 3], directions.shape), directions], axis=1).astype(np.float32)
    return scene.cast_rays(o3d.core.Tensor(rays))["t_hit"].numpy().reshape(camera.height, camera.width)
