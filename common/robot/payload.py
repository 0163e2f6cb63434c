"""A box in the gripper: one more body of the arm, fixed to its last frame."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import coal
import numpy as np
from numpy.typing import NDArray

from common.errors import RequestError
from common.geometry.transforms import pose_matrix
from common.robot.body_distance import pair_distance
from common.robot.kernels import FAR, BodyGrids
from common.robot.model import RobotModel
from common.robot.pair_tables import NO_TABLE, PairTables
from common.robot.pairs import coal_mesh
from common.robot.solids import Body, box_mesh, build_grids

__all__ = ["PAYLOAD", "Payload", "joined_grids", "payload_body", "with_payload", "with_payload_grids", "with_payload_shape"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
PAYLOAD = "payload"  # name of the body
LEAST_M, MOST_M = 0.005, 0.3  # edges of a box; our choice: a voxel of the distance grids, and what a gripper of these arms can carry
FARTHEST_M = 0.5  # of its middle from the tool's centre; our choice
SAMPLES = 300  # poses by which it is told what the box usually keeps from a link; our choice
SEED = 20220707


@dataclass(frozen=True)
class Payload:
    """A box that is held: ``size_m`` its full extents, ``position_m`` and ``quaternion_xyzw`` of its middle in the tool frame.

    Raises:
        RequestError: a size or position that makes no sense; names field and value.
    """

    size_m: tuple[float, float, float]
    position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    quaternion_xyzw: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        if len(self.size_m) != 3 or not all(LEAST_M <= edge <= MOST_M for edge in self.size_m):
            raise RequestError(f"size_m: needs 3 edges of {LEAST_M} to {MOST_M} m, got {list(self.size_m)}", code="bad_payload_box")
        if len(self.position_m) != 3 or not np.linalg.norm(self.position_m) <= FARTHEST_M:
            raise RequestError(
                f"position_m: needs 3 numbers, at most {FARTHEST_M} m from the tool, got {list(self.position_m)}", code="bad_payload_box"
            )
        if len(self.quaternion_xyzw) != 4 or not 1e-6 < np.linalg.norm(self.quaternion_xyzw) < np.inf:
            raise RequestError(f"quaternion_xyzw: is no turn: {list(self.quaternion_xyzw)}", code="bad_payload_box")

    @staticmethod
    def of(size_m: Sequence[float], position_m: Sequence[float] | None, quaternion_xyzw: Sequence[float] | None) -> Payload:
        """From a message's lists; absent ones are the tool's own place and turn."""
        position = (0.0, 0.0, 0.0) if position_m is None else position_m
        turn = (0.0, 0.0, 0.0, 1.0) if quaternion_xyzw is None else quaternion_xyzw
        return Payload(tuple(map(float, size_m)), tuple(map(float, position)), tuple(map(float, turn)))  # type: ignore[arg-type]


def payload_body(robot: RobotModel, payload: Payload) -> Body:
    """The box as a body of the arm."""
    vertices, triangles = box_mesh(list(payload.size_m))
    T = _in_joint_frame(robot, payload)
    return Body(PAYLOAD, robot.n_joints, vertices @ T[:3, :3].T + T[:3, 3], triangles, False)


def _in_joint_frame(robot: RobotModel, payload: Payload) -> F64:
    return np.asarray(robot.T_joint_tool @ pose_matrix(payload.position_m, payload.quaternion_xyzw))


def with_payload_shape(robot: RobotModel, payload: Payload) -> RobotModel:
    """The arm that holds a box, for those who need bodies and pairs but no distances; at once. Its distance grids are the bare arm's."""
    bodies = (*robot.bodies, payload_body(robot, payload))
    digest = hashlib.sha256(f"{robot.fingerprint} {payload!r}".encode()).hexdigest()[:16]
    # Unlike a link it is joined to no body that it can move against, so its neighbour counts too; and none is left out for never coming
    # near: a box changes often, and a look at what is far costs nothing.
    pairs = [(b, len(robot.bodies)) for b, body in enumerate(robot.bodies) if body.joint != robot.n_joints]
    pairs_with_box = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    usual_m = np.full(len(pairs), np.inf)
    tables = robot.pair_tables
    return replace(
        robot,
        bodies=bodies,
        pairs=np.vstack([robot.pairs, pairs_with_box]),
        pair_usual_m=np.concatenate([robot.pair_usual_m, usual_m]),
        pair_tables=PairTables(
            table=np.concatenate([tables.table, np.full(len(pairs), NO_TABLE)]),
            first_joint=np.concatenate([tables.first_joint, np.zeros(len(pairs), dtype=np.int64)]),
            distance_m=tables.distance_m,
        ),
        fingerprint=digest,
    )


def with_payload_grids(robot: RobotModel, payload: Payload) -> RobotModel:
    """The same with distances, but nothing known of what the box usually keeps from the links."""
    held = with_payload_shape(robot, payload)
    return replace(held, grids=joined_grids(robot.grids, build_grids(held.bodies[-1:], robot.grids.spacing_m)))


def with_payload(robot: RobotModel, payload: Payload) -> RobotModel:
    """The arm that holds a box: its bodies and the box as the last one. About half a second; pure.

    Raises:
        RequestError: the box is in a link that carries the tool, whatever the pose.
    """
    held = with_payload_grids(robot, payload)
    usual_m = _usual_m(held, held.pairs[len(robot.pairs) :], payload)
    return replace(held, pair_usual_m=np.concatenate([robot.pair_usual_m, usual_m]))


def joined_grids(a: BodyGrids, b: BodyGrids) -> BodyGrids:
    """The bodies of ``a``, then those of ``b``."""

    def offsets(first: I64, second: I64) -> I64:
        return np.concatenate([first, first[-1] + second[1:]])

    joined: dict[str, Any] = {
        name: np.concatenate([getattr(a, name), getattr(b, name)])
        for name in BodyGrids._fields
        if name != "spacing_m" and not name.endswith("offset")
    }
    shifted: dict[str, Any] = {name: offsets(getattr(a, name), getattr(b, name)) for name in BodyGrids._fields if name.endswith("offset")}
    return BodyGrids(**joined, **shifted, spacing_m=a.spacing_m)


def _usual_m(robot: RobotModel, pairs: I64, payload: Payload) -> F64:
    """(P,) what pairs (P, 2) of a body and the box usually keep; refuses a box that is in a body in every pose."""
    limits = (robot.position_min_rad, robot.position_max_rad)
    poses = robot.joint_poses(np.random.default_rng(SEED).uniform(*limits, (SAMPLES, robot.n_joints)))
    rotation, translation = np.ascontiguousarray(poses[..., :3, :3]), np.ascontiguousarray(poses[..., :3, 3])
    box, T_joint_box = coal.Box(*payload.size_m), _in_joint_frame(robot, payload)
    usual = np.empty(len(pairs))
    for i, (a, b) in enumerate(pairs):
        apart = np.array([pair_distance(robot.grids, a, b, R, t, FAR / 2.0) for R, t in zip(rotation, translation, strict=True)])
        usual[i] = np.median(apart)
        if apart.max() <= 0.0:
            mesh, joint = coal_mesh(robot.bodies[a]), robot.bodies[a].joint
            if all(_touch(mesh, T[joint], box, T[-1] @ T_joint_box) for T in poses):
                raise RequestError(f"the box is in {robot.bodies[a].name}, whatever the pose", code="bad_payload_box")
    return usual


def _touch(mesh: coal.BVHModelOBBRSS, T_world_mesh: F64, box: coal.Box, T_world_box: F64) -> bool:
    """Whether the solid box and the mesh touch; a mesh within the box does."""
    result = coal.CollisionResult()
    places = [coal.Transform3s(np.ascontiguousarray(T[:3, :3]), T[:3, 3].copy()) for T in (T_world_mesh, T_world_box)]
    coal.collide(mesh, places[0], box, places[1], coal.CollisionRequest(), result)
    return bool(result.isCollision())
