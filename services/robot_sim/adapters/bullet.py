"""The world in PyBullet: arm, fixed things, obstacles; steps, distances and contacts. The only module that knows PyBullet.

Everything goes through one client id; a second world in the same process is another world.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as p
from numpy.typing import NDArray

from common.cell import SolidConfig
from common.geometry.transforms import quaternion_of, rpy_matrix
from common.robot.model import RobotModel
from services.robot_sim.adapters.bullet_arm import frame_link, write_urdf
from services.robot_sim.core.contacts import Touch
from services.robot_sim.core.obstacles import Thing
from services.robot_sim.core.scripts import Pose

__all__ = ["Nearest", "World"]

F64 = NDArray[np.float64]
SERVO_EFFORT = 1000.0  # N m; ideal servos: a push moves the arm by less than the tracking limit. Our choice
POSITION_GAIN = 0.2  # of the position error, taken away per physics step; measured: 0.1 to 0.5 track alike
CONTACT_M = 0.0  # PyBullet reports points before they touch; only these are contacts


@dataclass(frozen=True)
class Nearest:
    """Smallest distance between a body of the arm and something else; negative: they overlap."""

    distance_m: float
    part: str
    other: str


class World:
    """Arm, fixed things, obstacles. ``close`` it, or use it in ``with``.

    PyBullet gives the arm's meshes a margin of 1 mm: distances are that much smaller than the true ones, contacts that much earlier.
    """

    def __init__(self, robot: RobotModel, static: list[SolidConfig], step_s: float) -> None:
        self._robot = robot
        self._step_s = step_s
        self._client = p.connect(p.DIRECT)
        self._names: dict[int, str] = {}
        self._static: list[int] = []
        self._obstacles: dict[str, int] = {}
        p.setGravity(0.0, 0.0, -9.81, physicsClientId=self._client)
        p.setPhysicsEngineParameter(fixedTimeStep=step_s, numSubSteps=0, deterministicOverlappingPairs=1, physicsClientId=self._client)
        for solid in static:
            T = rpy_matrix(solid.position_m, solid.rpy_rad)
            body = self._create(solid.name, solid.shape, solid.size_m, Pose(T[:3, 3], quaternion_of(T)))
            self._static.append(body)
        self._stand_arm()
        self.reset(robot.home_rad)

    def __enter__(self) -> World:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the physics client."""
        if self._client >= 0:
            p.disconnect(physicsClientId=self._client)
            self._client = -1

    # --- the arm ---

    def _stand_arm(self) -> None:
        with tempfile.TemporaryDirectory(prefix="tolman-arm-") as folder:
            self._load_arm(write_urdf(self._robot, Path(folder)))
        self._immobile = [b.name for b in self._robot.bodies if b.immobile]
        for name in self._immobile:  # it stands in the table or on it
            for body in self._static:
                self._collide(self._arm, self._link_of[name], body, -1, False)

    def _load_arm(self, path: Path) -> None:
        robot = self._robot
        base = robot.joint_poses(robot.home_rad[None])[0, 0]
        self._arm = p.loadURDF(
            str(path),
            basePosition=base[:3, 3].tolist(),
            baseOrientation=quaternion_of(base).tolist(),
            useFixedBase=True,
            flags=p.URDF_USE_INERTIA_FROM_FILE | p.URDF_USE_SELF_COLLISION | p.URDF_MAINTAIN_LINK_ORDER,
            physicsClientId=self._client,
        )
        infos = [
            p.getJointInfo(self._arm, i, physicsClientId=self._client)
            for i in range(p.getNumJoints(self._arm, physicsClientId=self._client))
        ]
        links = {info[12].decode(): i for i, info in enumerate(infos)}
        self._joints = [links[frame_link(j + 1)] for j in range(robot.n_joints)]
        self._link_of = {body.name: links[body.name] for body in robot.bodies}
        self._part_of = {link: name for name, link in self._link_of.items()}
        allowed = {frozenset((robot.bodies[a].name, robot.bodies[b].name)) for a, b in robot.pairs}
        for a, link_a in self._link_of.items():
            for b, link_b in self._link_of.items():
                if link_a < link_b and frozenset((a, b)) not in allowed:
                    self._collide(self._arm, link_a, self._arm, link_b, False)
        for link in range(len(infos)):
            p.changeDynamics(self._arm, link, linearDamping=0.0, angularDamping=0.0, jointDamping=0.0, physicsClientId=self._client)

    def _collide(self, body_a: int, link_a: int, body_b: int, link_b: int, enabled: bool) -> None:
        p.setCollisionFilterPair(body_a, body_b, link_a, link_b, int(enabled), physicsClientId=self._client)

    def change_arm(self, robot: RobotModel, q_rad: F64) -> None:
        """Another arm in the same place, standing at ``q_rad`` (J,): it holds something, or no more."""
        p.removeBody(self._arm, physicsClientId=self._client)
        self._robot = robot
        self._stand_arm()
        self.reset(q_rad)

    def reset(self, q_rad: F64) -> None:
        """Put the arm at ``q_rad`` (J,), at rest."""
        for joint, q in zip(self._joints, q_rad, strict=True):
            p.resetJointState(self._arm, joint, float(q), 0.0, physicsClientId=self._client)
        p.performCollisionDetection(physicsClientId=self._client)

    def step(self, q_from_rad: F64, q_to_rad: F64) -> None:
        """One physics step in which the reference (J,) goes from one place to the other.

        PyBullet's servo sees the position error before the step and sets the velocity of the step: given the place at the beginning and
        the mean velocity it ends exactly where it should (given the place at the end it leads by a step: measured, 1.6 mrad at 0.8 rad/s).
        """
        p.setJointMotorControlArray(
            self._arm,
            self._joints,
            p.POSITION_CONTROL,
            targetPositions=q_from_rad.tolist(),
            targetVelocities=((q_to_rad - q_from_rad) / self._step_s).tolist(),
            forces=[SERVO_EFFORT] * len(self._joints),
            positionGains=[POSITION_GAIN] * len(self._joints),
            velocityGains=[1.0] * len(self._joints),
            physicsClientId=self._client,
        )
        p.stepSimulation(physicsClientId=self._client)

    def joints(self) -> tuple[F64, F64]:
        """Measured position and velocity (J,)."""
        states = p.getJointStates(self._arm, self._joints, physicsClientId=self._client)
        return np.array([s[0] for s in states]), np.array([s[1] for s in states])

    def frame_poses(self) -> F64:
        """(J, 4, 4) world poses of the moving joint frames as the engine has them."""
        states = p.getLinkStates(self._arm, self._joints, computeForwardKinematics=1, physicsClientId=self._client)
        poses = np.zeros((len(states), 4, 4))
        for T, state in zip(poses, states, strict=True):
            T[:3, :3] = np.array(p.getMatrixFromQuaternion(state[5])).reshape(3, 3)
            T[:3, 3], T[3, 3] = state[4], 1.0
        return poses

    # --- obstacles ---

    def add(self, thing: Thing) -> None:
        """A new obstacle, moved by nothing but :meth:`place`."""
        self._obstacles[thing.id] = self._create(thing.id, thing.shape, list(thing.size_m), thing.pose)

    def place(self, id: str, pose: Pose) -> None:
        """Put an obstacle there."""
        p.resetBasePositionAndOrientation(
            self._obstacles[id], pose.position_m.tolist(), pose.quaternion_xyzw.tolist(), physicsClientId=self._client
        )

    def remove(self, id: str) -> None:
        """Take an obstacle away."""
        body = self._obstacles.pop(id)
        del self._names[body]
        p.removeBody(body, physicsClientId=self._client)

    def _create(self, name: str, shape: str, size_m: list[float], pose: Pose) -> int:
        arguments: dict[str, Any]
        if shape == "box":
            arguments = {"shapeType": p.GEOM_BOX, "halfExtents": [s / 2.0 for s in size_m]}
        elif shape == "sphere":
            arguments = {"shapeType": p.GEOM_SPHERE, "radius": size_m[0]}
        else:
            kind = p.GEOM_CYLINDER if shape == "cylinder" else p.GEOM_CAPSULE
            arguments = {"shapeType": kind, "radius": size_m[0], "height": size_m[1]}
        collision = p.createCollisionShape(**arguments, physicsClientId=self._client)
        body: int = p.createMultiBody(
            baseMass=0.0,
            baseCollisionShapeIndex=collision,
            basePosition=pose.position_m.tolist(),
            baseOrientation=pose.quaternion_xyzw.tolist(),
            physicsClientId=self._client,
        )
        self._names[body] = name
        return body

    # --- distances and contacts ---

    def gap_m(self, id: str, pose: Pose, reach_m: float) -> float:
        """Distance between the arm and an obstacle at ``pose``; ``reach_m`` if it is farther. Leaves the obstacle there."""
        self.place(id, pose)
        points = p.getClosestPoints(self._arm, self._obstacles[id], reach_m, physicsClientId=self._client)
        return min((point[8] for point in points), default=reach_m)

    def nearest_obstacle(self, reach_m: float) -> Nearest | None:
        """The closest pair of arm and obstacle within ``reach_m``."""
        return self._nearest_of(self._obstacles.values(), reach_m)

    def nearest_static(self, reach_m: float) -> Nearest | None:
        """The closest pair of a moving body of the arm and a fixed thing within ``reach_m``."""
        return self._nearest_of(self._static, reach_m)

    def _nearest_of(self, bodies: Iterable[int], reach_m: float) -> Nearest | None:
        best: Nearest | None = None
        for body in bodies:
            for point in p.getClosestPoints(self._arm, body, reach_m, physicsClientId=self._client):
                if self._counts(point) and (best is None or point[8] < best.distance_m):
                    best = Nearest(point[8], self._part_of[point[3]], self._names[body])
        return best

    def nearest_self(self, reach_m: float) -> Nearest | None:
        """The closest pair of two bodies of the arm that can touch one another, within ``reach_m``."""
        best: Nearest | None = None
        for a, b in self._robot.pairs:
            name_a, name_b = self._robot.bodies[a].name, self._robot.bodies[b].name
            links = {"linkIndexA": self._link_of[name_a], "linkIndexB": self._link_of[name_b]}
            for point in p.getClosestPoints(self._arm, self._arm, reach_m, **links, physicsClientId=self._client):
                if best is None or point[8] < best.distance_m:
                    best = Nearest(point[8], name_a, name_b)
        return best

    def touches(self, q_rad: F64, dq_commanded_rad_s: F64) -> list[Touch]:
        """What the arm touches since the last step.

        Args:
            q_rad: (J,) where it is.
            dq_commanded_rad_s: (J,) velocity that it was told to have. The measured one would not do: the engine slows the arm just before
                it touches.
        """
        points = p.getContactPoints(bodyA=self._arm, physicsClientId=self._client)
        return [self._touch(point, q_rad, dq_commanded_rad_s) for point in points if point[8] <= CONTACT_M and self._counts(point)]

    def _counts(self, point: tuple[Any, ...]) -> bool:
        """Whether a point is between a moving body of the arm and something that it should not touch."""
        on_obstacle = point[2] in self._obstacles.values()
        return on_obstacle or self._part_of[point[3]] not in self._immobile

    def _touch(self, point: tuple[Any, ...], q_rad: F64, dq_rad_s: F64) -> Touch:
        link, other_body, other_link = point[3], point[2], point[4]
        other = self._part_of[other_link] if other_body == self._arm else self._names[other_body]
        towards_other = -np.array(point[7])  # PyBullet's normal points from B to A, the arm
        speed = float(self._velocity(link, point[5], q_rad, dq_rad_s) @ towards_other)
        return Touch(self._part_of[link], other, other_body in self._obstacles.values(), speed)

    def _velocity(self, link: int, at_m: Iterable[float], q_rad: F64, dq_rad_s: F64) -> F64:
        """World velocity (3,) of the point of a link that is at ``at_m``."""
        state = p.getLinkState(self._arm, link, computeForwardKinematics=1, physicsClientId=self._client)
        rotation = np.array(p.getMatrixFromQuaternion(state[1])).reshape(3, 3)
        local = rotation.T @ (np.array(list(at_m)) - np.array(state[0]))  # in the frame of the link's centre of mass
        linear, _ = p.calculateJacobian(
            self._arm, link, local.tolist(), q_rad.tolist(), dq_rad_s.tolist(), [0.0] * len(q_rad), physicsClientId=self._client
        )
        velocity: F64 = np.array(linear) @ dq_rad_s
        return velocity
