"""The referee of every path: coal on the bare meshes and the true shapes, at steps of 1/256 rad.

It shares no code with the check that it judges.
"""

from __future__ import annotations

from itertools import pairwise

import coal
import numpy as np
from numpy.typing import NDArray

from common.cell import SolidConfig
from common.geometry.grid import Grid
from common.geometry.transforms import rpy_matrix
from common.robot.model import RobotModel
from common.robot.pairs import coal_mesh

__all__ = ["STEP_RAD", "Referee", "at_steps"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
Thing = tuple[coal.CollisionGeometry, coal.Transform3s]
STEP_RAD = 1.0 / 256.0  # issue


def at_steps(q_rad: F64, step_rad: float = STEP_RAD) -> F64:
    """(K, J) points of the polyline ``q_rad`` (P, J), no joint moving more than ``step_rad`` between two of them.

    Corners that lie closer together than that are passed over, as far as the step allows; first and last point are always there.
    """
    q_rad = _thinned(q_rad, step_rad)
    parts = [q_rad[:1]]
    for a, b in pairwise(q_rad):
        n = max(1, int(np.ceil(np.abs(b - a).max() / step_rad)))
        parts.append(a + (b - a) * (np.arange(1, n + 1) / n)[:, None])
    return np.concatenate(parts)


def _thinned(q_rad: F64, step_rad: float) -> F64:
    """The corners without those that lie, with the next one, within ``step_rad`` of the last one kept."""
    kept = [0]
    for k in range(1, len(q_rad) - 1):
        if np.abs(q_rad[k : k + 2] - q_rad[kept[-1]]).max() > step_rad:
            kept.append(k)
    return q_rad[[*kept, len(q_rad) - 1]] if len(q_rad) > 1 else q_rad


class Referee:
    """Says whether a pose truly touches a box, the static layer or itself."""

    def __init__(self, robot: RobotModel, static: list[SolidConfig]) -> None:
        self._robot = robot
        self._bodies = [(coal_mesh(body), body.joint, body.immobile) for body in robot.bodies]
        self._static = [(_shape(solid), _transform(rpy_matrix(solid.position_m, solid.rpy_rad))) for solid in static]
        self._request = coal.CollisionRequest()

    def collides(self, q_rad: F64, boxes_m: F64) -> bool:
        """Whether any of the poses (K, J) touches a box of ``boxes_m`` (n, 2, 3: lowest, highest corner), the static layer or itself."""
        return self._any_touches(q_rad, [_box(low, high) for low, high in boxes_m])

    def path_collides(self, path_rad: F64, grid: Grid, cells: I32, boxes_m: F64 | None = None) -> bool:
        """Whether the polyline ``path_rad`` (P, J), looked at every ``STEP_RAD``, touches one of the flat ``cells`` (C,) of ``grid``, a
        box of ``boxes_m`` (n, 2, 3), the static layer or itself.
        """
        things = [_box(low, high) for low, high in boxes_m] if boxes_m is not None else []
        if len(cells):
            things.append(_cells(grid, cells))
        return self._any_touches(at_steps(path_rad), things)

    def _any_touches(self, q_rad: F64, movable: list[Thing]) -> bool:
        things = [*self._static, *movable]
        for frames in self._robot.joint_poses(q_rad):
            poses = [_transform(frame) for frame in frames]
            if self._touches_things(poses, things) or self._touches_itself(poses):
                return True
        return False

    def _touches_things(self, poses: list[coal.Transform3s], things: list[Thing]) -> bool:
        return any(
            not immobile and self._touch(mesh, poses[joint], shape, placed)
            for mesh, joint, immobile in self._bodies
            for shape, placed in things
        )

    def _touches_itself(self, poses: list[coal.Transform3s]) -> bool:
        for a, b in self._robot.pairs:
            (mesh_a, joint_a, _), (mesh_b, joint_b, _) = self._bodies[a], self._bodies[b]
            if self._touch(mesh_a, poses[joint_a], mesh_b, poses[joint_b]):
                return True
        return False

    def _touch(self, a: coal.CollisionGeometry, pose_a: coal.Transform3s, b: coal.CollisionGeometry, pose_b: coal.Transform3s) -> bool:
        result = coal.CollisionResult()
        coal.collide(a, pose_a, b, pose_b, self._request, result)
        return bool(result.isCollision())


def _shape(solid: SolidConfig) -> coal.CollisionGeometry:
    if solid.shape == "box":
        return coal.Box(*solid.size_m)
    if solid.shape == "cylinder":
        return coal.Cylinder(*solid.size_m)
    return coal.Sphere(*solid.size_m)


def _cells(grid: Grid, cells: I32) -> Thing:
    """Cells as the leaves of one octree, which coal takes as the boxes that they are; leaves lie on multiples of their edge."""
    T = np.eye(4)
    T[:3, 3] = grid.origin_m
    return coal.makeOctree(grid.centres(cells) - T[:3, 3], grid.resolution_m), _transform(T)


def _box(low: F64, high: F64) -> Thing:
    T = np.eye(4)
    T[:3, 3] = (low + high) / 2.0
    return coal.Box(*(high - low)), _transform(T)


def _transform(T: F64) -> coal.Transform3s:
    return coal.Transform3s(np.ascontiguousarray(T[:3, :3]), np.ascontiguousarray(T[:3, 3]))
