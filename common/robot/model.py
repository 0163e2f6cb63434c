"""The robot model: any serial arm from a URDF, with everything that geometry and planning need, loaded once per process."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from common.cell import RobotConfig
from common.errors import RobotError
from common.geometry.transforms import rpy_matrix
from common.robot.geometry import geometry_of
from common.robot.kernels import BodyGrids, Chain, forward_kinematics_batch
from common.robot.pair_tables import PairTables
from common.robot.solids import GRID_REACH_M, Body, mesh_of_solid
from common.robot.urdf import load_bodies, load_kinematics, resolve

__all__ = ["RobotModel", "chain_of", "load_robot"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
VERSION = 5  # raise when the meaning of what is loaded changes: maps and recorded motions of before are then another arm's


@dataclass(frozen=True, eq=False)
class RobotModel:
    """A serial arm with J joints and B rigid bodies.

    Attributes:
        position_min_rad, position_max_rad: (J,) limits, the URDF's narrowed by the config's.
        max_velocity_rad_s, max_acceleration_rad_s2: (J,) limits (metres instead of radians at a sliding joint).
        home_rad: (J,) resting configuration.
        bodies: the rigid bodies; the tool, if there is one, is the last.
        chain, grids: the same arm as flat arrays for kernels.
        pairs: (P, 2) bodies that can touch one another.
        pair_usual_m: (P,) distance that each pair has in half of all poses or more, by the spheres.
        pair_tables: distances of those of them that are two joints apart.
        T_joint_tool: (4, 4) pose of the tool frame in the last joint's frame.
        fingerprint: 16 hex digits of URDF, meshes, tool and limits.
    """

    name: str
    joint_names: tuple[str, ...]
    position_min_rad: F64
    position_max_rad: F64
    max_velocity_rad_s: F64
    max_acceleration_rad_s2: F64
    home_rad: F64
    urdf_path: Path
    package_dirs: list[Path]
    bodies: tuple[Body, ...]
    chain: Chain
    grids: BodyGrids
    pairs: I64
    pair_usual_m: F64
    pair_tables: PairTables
    T_joint_tool: F64
    fingerprint: str

    @property
    def n_joints(self) -> int:
        """Number of moving joints."""
        return len(self.joint_names)

    def joint_poses(self, q_rad: F64) -> F64:
        """``T_world_joint`` (K, J + 1, 4, 4) of all frames (0 = base) for ``q_rad`` (K, J)."""
        q = np.ascontiguousarray(q_rad, dtype=np.float64)
        if q.ndim != 2 or q.shape[1] != self.n_joints:
            raise ValueError(f"q_rad must have shape (K, {self.n_joints}), got {q.shape}")
        rotation = np.empty((len(q), self.n_joints + 1, 3, 3))
        translation = np.empty((len(q), self.n_joints + 1, 3))
        forward_kinematics_batch(self.chain, q, rotation, translation)
        poses = np.zeros((len(q), self.n_joints + 1, 4, 4))
        poses[..., :3, :3], poses[..., :3, 3], poses[..., 3, 3] = rotation, translation, 1.0
        return poses

    def tool_pose(self, q_rad: F64) -> F64:
        """``T_world_tool`` (4, 4) of the tool frame for ``q_rad`` (J,)."""
        pose: F64 = self.joint_poses(np.asarray(q_rad, dtype=np.float64)[None])[0, -1] @ self.T_joint_tool
        return pose

    def limit_violation(self, q_rad: F64) -> str | None:
        """What is wrong with a joint vector as a place to be, naming joint and value; None if nothing is.

        Checks length, finiteness and position limits.
        """
        return _violation(self.joint_names, self.position_min_rad, self.position_max_rad, q_rad)


def _violation(joint_names: Sequence[str], low: F64, high: F64, q_rad: ArrayLike) -> str | None:
    q = np.asarray(q_rad, dtype=np.float64)
    if q.shape != (len(joint_names),):
        return f"q_rad must have {len(joint_names)} values, got shape {list(q.shape)}"
    for name, value, least, most in zip(joint_names, q, low, high, strict=True):
        if not np.isfinite(value):
            return f"{name}: {value} is not a finite number"
        if not least <= value <= most:
            return f"{name}: {value:.6g} rad is outside its limits [{least:.6g}, {most:.6g}]"
    return None


def load_robot(config: RobotConfig) -> RobotModel:
    """The model of a configured arm.

    Raises:
        RobotError: URDF or mesh not found, not a serial arm, wrong number of values for its joints, home outside the limits.
    """
    path, package_dirs = resolve(config.urdf)
    model, geometry = load_kinematics(path, package_dirs, config.locked_joints)
    n_joints, joint_names = model.njoints - 1, tuple(model.names)[1:]
    if len(config.home_rad) != n_joints:
        raise RobotError(f"robot.home_rad has {len(config.home_rad)} values, {path.name} has {n_joints} joints")
    T_joint_flange = _flange(model, config.flange_frame, path.name)
    bodies = load_bodies(model, geometry, config.immobile_links)
    bodies += _tool_bodies(config, T_joint_flange, n_joints)
    chain = chain_of(model, config)
    low, high, velocity = _limits(model, config)
    violation = _violation(joint_names, low, high, config.home_rad)
    if violation:
        raise RobotError(f"robot.home_rad: {violation}")
    fingerprint = _fingerprint(config, bodies, chain, low, high, velocity)
    grids, pairs, pair_usual_m, pair_tables = geometry_of(bodies, chain, low, high, config.voxel_m)
    return RobotModel(
        name=config.name,
        joint_names=joint_names,
        position_min_rad=low,
        position_max_rad=high,
        max_velocity_rad_s=velocity,
        max_acceleration_rad_s2=np.array(config.max_acceleration_rad_s2),
        home_rad=np.array(config.home_rad),
        urdf_path=path,
        package_dirs=package_dirs,
        bodies=tuple(bodies),
        chain=chain,
        grids=grids,
        pairs=pairs,
        pair_usual_m=pair_usual_m,
        pair_tables=pair_tables,
        T_joint_tool=T_joint_flange @ rpy_matrix(config.tool.tcp_position_m, config.tool.tcp_rpy_rad),
        fingerprint=fingerprint,
    )


def _flange(model: pin.Model, frame: str, file: str) -> F64:
    """(4, 4) pose of the flange in the last joint's frame."""
    if not model.existFrame(frame):
        raise RobotError(f"robot.flange_frame: {file} has no frame {frame!r}")
    flange = model.frames[model.getFrameId(frame)]
    if flange.parentJoint != model.njoints - 1:
        raise RobotError(f"robot.flange_frame: {frame!r} does not move with the last joint")
    return np.asarray(flange.placement.homogeneous)


def _tool_bodies(config: RobotConfig, T_joint_flange: F64, n_joints: int) -> list[Body]:
    if not config.tool.solids:
        return []
    vertices, triangles, count = [], [], 0
    for solid in config.tool.solids:
        v, t = mesh_of_solid(solid)
        vertices.append(v @ T_joint_flange[:3, :3].T + T_joint_flange[:3, 3])
        triangles.append(t + count)
        count += len(v)
    return [Body("tool", n_joints, np.vstack(vertices), np.vstack(triangles).astype(np.int32), False)]


def chain_of(model: pin.Model, config: RobotConfig) -> Chain:
    """The joints of a serial arm, standing where the config says, as the kernels want them."""
    base = rpy_matrix(config.base_position_m, config.base_rpy_rad)
    placements = [model.jointPlacements[j] for j in range(1, model.njoints)]
    axes, prismatic = [], []
    for j in range(1, model.njoints):
        joint = model.joints[j]
        data = joint.createData()
        joint.calc(data, pin.neutral(model))
        motion = np.asarray(data.S).ravel()
        slides = bool(np.linalg.norm(motion[:3]) > 0.5)
        axes.append(motion[:3] if slides else motion[3:])
        prismatic.append(slides)
    return Chain(
        base_rotation=np.ascontiguousarray(base[:3, :3]),
        base_translation=base[:3, 3].copy(),
        rotation=np.array([p.rotation for p in placements]),
        translation=np.array([p.translation for p in placements]),
        axis=np.array(axes),
        prismatic=np.array(prismatic, dtype=np.uint8),
    )


def _limits(model: pin.Model, config: RobotConfig) -> tuple[F64, F64, F64]:
    low, high = np.array(model.lowerPositionLimit), np.array(model.upperPositionLimit)
    velocity = np.array(model.velocityLimit)
    for name, mine, theirs, narrow in (
        ("position_min_rad", config.position_min_rad, low, np.maximum),
        ("position_max_rad", config.position_max_rad, high, np.minimum),
        ("max_velocity_rad_s", config.max_velocity_rad_s, velocity, np.minimum),
    ):
        if mine is None:
            continue
        if len(mine) != len(theirs):
            raise RobotError(f"robot.{name} has {len(mine)} values, the arm has {len(theirs)} joints")
        theirs[:] = narrow(theirs, np.asarray(mine, dtype=np.float64))
    if not np.all(low < high):
        raise RobotError(f"robot: position limits are empty at joints {[model.names[int(j) + 1] for j in np.flatnonzero(low >= high)]}")
    if not np.all(np.isfinite(velocity) & (velocity > 0.0)):
        raise RobotError("robot.max_velocity_rad_s: the URDF gives no velocity limit for every joint; state them in the config")
    return low, high, velocity


def _fingerprint(config: RobotConfig, bodies: Sequence[Body], chain: Chain, *limits: F64) -> str:
    digest = hashlib.sha256(f"{VERSION} {config.voxel_m} {GRID_REACH_M}".encode())
    rest = {name: value for name, value in msgspec.to_builtins(config, order="deterministic").items() if name != "voxel_m"}
    digest.update(msgspec.msgpack.encode(rest))
    for body in bodies:
        digest.update(f"{body.name} {body.joint} {body.immobile}".encode())
        digest.update(body.vertices.tobytes())
        digest.update(body.triangles.tobytes())
    for array in (*chain, *limits):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:16]
