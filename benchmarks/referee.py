"""The referee of every path: coal on the bare meshes and the true shapes, at steps of 1/256 rad.

It shares no code with the check that it judges. Coal is asked only about what is near: a ball round each body against the axis-parallel
box round each thing.
"""

from __future__ import annotations

from dataclasses import dataclass
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
STEP_RAD = 1.0 / 256.0  # issue
ROUNDING_M = 1e-9  # by which balls are larger than the bodies in them


@dataclass(frozen=True, eq=False)
class _Thing:
    """What stands in the way: a shape, where it is, and the lowest and highest corner (3,) of an axis-parallel box round it, in metres."""

    shape: coal.CollisionGeometry
    placed: coal.Transform3s
    low_m: F64
    high_m: F64


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
        self._meshes = [coal_mesh(body) for body in robot.bodies]
        self._joint = np.array([body.joint for body in robot.bodies])
        self._moves = np.array([not body.immobile for body in robot.bodies])
        self._centre_m = np.array([(body.vertices.min(axis=0) + body.vertices.max(axis=0)) / 2.0 for body in robot.bodies])
        balls = zip(robot.bodies, self._centre_m, strict=True)
        self._radius_m = np.array([np.linalg.norm(body.vertices - c, axis=1).max() for body, c in balls]) + ROUNDING_M
        self._static = [_solid(solid) for solid in static]
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

    def _any_touches(self, q_rad: F64, movable: list[_Thing]) -> bool:
        things = [*self._static, *movable]
        frames = self._robot.joint_poses(q_rad)[:, self._joint]
        near_thing, near_pair = self._near(frames, things)
        for k in np.flatnonzero(near_thing.any(axis=(1, 2)) | near_pair.any(axis=1)):
            poses = [_transform(frame) for frame in frames[k]]
            if any(self._touch(b, poses[b], things[t].shape, things[t].placed) for b, t in np.argwhere(near_thing[k])):
                return True
            pairs = self._robot.pairs[near_pair[k]]
            if any(self._touch(a, poses[a], self._meshes[b], poses[b]) for a, b in pairs):
                return True
        return False

    def _near(self, frames: F64, things: list[_Thing]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """(K, B, T) which bodies may touch which things, and (K, P) which pairs of bodies may touch, at poses (K, B, 4, 4) of bodies."""
        ball = np.einsum("kbij,bj->kbi", frames[..., :3, :3], self._centre_m) + frames[..., :3, 3]
        near_thing = np.zeros((*ball.shape[:2], len(things)), dtype=np.bool_)
        for t, thing in enumerate(things):
            gap = np.maximum(np.maximum(thing.low_m - ball, ball - thing.high_m), 0.0)
            near_thing[..., t] = (np.linalg.norm(gap, axis=-1) <= self._radius_m) & self._moves
        a, b = np.asarray(self._robot.pairs).reshape(-1, 2).T
        return near_thing, np.linalg.norm(ball[:, a] - ball[:, b], axis=-1) <= self._radius_m[a] + self._radius_m[b]

    def _touch(self, body: int, pose: coal.Transform3s, other: coal.CollisionGeometry, placed: coal.Transform3s) -> bool:
        result = coal.CollisionResult()
        coal.collide(self._meshes[body], pose, other, placed, self._request, result)
        return bool(result.isCollision())


def _solid(solid: SolidConfig) -> _Thing:
    if solid.shape == "box":
        shape, half_m = coal.Box(*solid.size_m), np.array(solid.size_m) / 2.0
    elif solid.shape == "cylinder":
        radius_m, length_m = solid.size_m
        shape, half_m = coal.Cylinder(radius_m, length_m), np.array([radius_m, radius_m, length_m / 2.0])
    else:
        shape, half_m = coal.Sphere(*solid.size_m), np.full(3, solid.size_m[0])
    T = rpy_matrix(solid.position_m, solid.rpy_rad)
    reach_m = np.abs(T[:3, :3]) @ half_m
    return _Thing(shape, _transform(T), T[:3, 3] - reach_m, T[:3, 3] + reach_m)


def _cells(grid: Grid, cells: I32) -> _Thing:
    """Cells as the leaves of one octree, which coal takes as the boxes that they are; leaves lie on multiples of their edge."""
    T = np.eye(4)
    T[:3, 3] = grid.origin_m
    centres, half_m = grid.centres(cells), grid.resolution_m / 2.0
    octree = coal.makeOctree(centres - T[:3, 3], grid.resolution_m)
    return _Thing(octree, _transform(T), centres.min(axis=0) - half_m, centres.max(axis=0) + half_m)


def _box(low: F64, high: F64) -> _Thing:
    T = np.eye(4)
    T[:3, 3] = (low + high) / 2.0
    return _Thing(coal.Box(*(high - low)), _transform(T), low, high)


def _transform(T: F64) -> coal.Transform3s:
    return coal.Transform3s(np.ascontiguousarray(T[:3, :3]), np.ascontiguousarray(T[:3, 3]))
