"""Motions that keep the direction of the tool: straight ways of the tool in space, joints following by inverse kinematics."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.paper.study import Study
from benchmarks.peers.coal_world import pinocchio_model
from common.errors import TolmanError
from common.robot.model import RobotModel
from services.planner.core.check import Checker
from services.planner.core.inverse_kinematics import InverseKinematics
from services.planner.core.world import no_cells
from services.planner.kernels.collision import FREE
from services.planner.offline.config import RegionConfig

__all__ = ["LevelMotions", "tilt_deg"]

F64 = NDArray[np.float64]
STEP_M, STEP_TURN_RAD = 0.01, 0.05  # of the tool between two joint vectors; our choice
JUMP_RAD = 0.5  # a larger joint step means that the arm would have to turn over
NEWTON_STEPS, DAMPING, EXACT = 20, 1e-6, 1e-8
VIA_MIN_M, VIA_MAX_M = (0.20, -0.15, 0.15), (0.45, 0.15, 0.45)  # the way bends at a place between the bins; our choice
ATTEMPTS = 60  # draws until a motion succeeds; measured: one in a hundred leaning motions needs more
MOTIONS_TRIED = 20  # motions until there is one, where there must be one
DOWN = Rotation.from_euler("x", np.pi)


def tilt_deg(robot: RobotModel, q_rad: F64, lean_deg: float) -> F64:
    """(K,) angle in degrees between the tool's axis and the direction that is to be kept, for (K, J) joint vectors."""
    poses = robot.joint_poses(np.ascontiguousarray(q_rad))[:, -1] @ robot.T_joint_tool
    wanted = _lean(lean_deg).apply([0.0, 0.0, -1.0])
    return np.asarray(np.degrees(np.arccos(np.clip(poses[:, :3, 2] @ wanted, -1.0, 1.0))))


class LevelMotions:
    """Draws places, poses and motions whose tool axis keeps one direction of the world; all begin on the branch nearest to home.

    ``lean_deg``: from straight down towards +y. The tool may turn about its axis.
    """

    def __init__(self, study: Study, lean_deg: float) -> None:
        parts = study.gng
        self.lean_deg = lean_deg
        self._robot = parts.robot
        self._motions = parts.config.motions
        self._checker: Checker = parts.checker()
        self._nothing = no_cells(parts.grid)
        self._inverse = InverseKinematics(parts.robot)
        self._model = pinocchio_model(parts.robot.chain)
        self._data = self._model.createData()
        self._T_joint_tool = pin.SE3(parts.robot.T_joint_tool)

    def pose(self, rng: np.random.Generator, region: RegionConfig) -> tuple[F64, float, F64] | None:
        """A place (3,) in the region, a turn about the tool's axis, and the free joint vector (J,) nearest to home; None if "
        "there is none."""
        place, turn = rng.uniform(region.min_m, region.max_m), float(rng.uniform(-region.turn_max_rad, region.turn_max_rad))
        found = [q for q in self._inverse.solve(_pose(place, turn, self.lean_deg)) if self._checker.pose(self._nothing, q)[0] == FREE]
        return (place, turn, min(found, key=lambda q: float(np.linalg.norm(q - self._robot.home_rad)))) if found else None

    def ends(self, rng: np.random.Generator) -> tuple[F64, F64]:
        """Start and goal (J,) of a plan: the ends of such a motion, so that one exists, on the branches that it joins.

        Raises:
            TolmanError: ``unreachable``: the regions give no such motion.
        """
        for _ in range(MOTIONS_TRIED):
            path = self.motion(rng)
            if path is not None:
                return path[0], path[-1]
        raise TolmanError(
            f"no motion with the tool leaning {self.lean_deg:g} degrees in {MOTIONS_TRIED * ATTEMPTS} draws", code="unreachable"
        )

    def motion(self, rng: np.random.Generator) -> F64 | None:
        """(K, J) a motion over a place between the regions, the tool in its direction all the way; None if none was possible."""
        regions = [self._motions.pick, self._motions.place]
        if rng.random() < 0.5:
            regions.reverse()
        for _ in range(ATTEMPTS):
            start = self.pose(rng, regions[0])
            if start is None:
                continue
            end_place = rng.uniform(regions[1].min_m, regions[1].max_m)
            end_turn = float(rng.uniform(-regions[1].turn_max_rad, regions[1].turn_max_rad))
            via = rng.uniform(VIA_MIN_M, VIA_MAX_M)
            path = self._follow(start[2], _way([start[0], via, end_place], start[1], end_turn, self.lean_deg))
            if path is not None and self._is_free(path):
                return path
        return None

    def _follow(self, q_start: F64, poses: list[F64]) -> F64 | None:
        path = [q_start]
        for T in poses[1:]:
            q = self._reach(path[-1], pin.SE3(T))
            if q is None or np.abs(q - path[-1]).max() > JUMP_RAD:
                return None
            path.append(q)
        return np.array(path)

    def _reach(self, q_from: F64, wanted: pin.SE3) -> F64 | None:
        """Damped Newton from the last joint vector; None if it does not get there within limits."""
        q, last = q_from.copy(), self._model.njoints - 1
        for _ in range(NEWTON_STEPS):
            jacobian = pin.computeJointJacobian(self._model, self._data, q, last)
            pin.forwardKinematics(self._model, self._data, q)
            tool = self._data.oMi[last] * self._T_joint_tool
            error = pin.log6(tool.actInv(wanted)).vector
            if np.linalg.norm(error) < EXACT:
                return q if self._robot.limit_violation(q) is None else None
            J = self._T_joint_tool.toActionMatrixInverse() @ jacobian
            q = q + J.T @ np.linalg.solve(J @ J.T + DAMPING * np.eye(6), error)
        return None

    def _is_free(self, path: F64) -> bool:
        return all(self._checker.segment(self._nothing, a, b) for a, b in pairwise(path))


def _lean(lean_deg: float) -> Rotation:
    return Rotation.from_euler("x", lean_deg, degrees=True)


def _pose(place: F64, turn_rad: float, lean_deg: float) -> F64:
    T = np.eye(4)
    T[:3, :3] = (_lean(lean_deg) * Rotation.from_euler("z", turn_rad) * DOWN).as_matrix()
    T[:3, 3] = place
    return T


def _way(places: list[F64], turn_from: float, turn_to: float, lean_deg: float) -> list[F64]:
    """Tool poses along the straight pieces between places, the turn changing evenly."""
    lengths = [float(np.linalg.norm(b - a)) for a, b in pairwise(places)]
    n = int(np.ceil(max(sum(lengths) / STEP_M, abs(turn_to - turn_from) / STEP_TURN_RAD))) + 1
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    s = np.linspace(0.0, along[-1], n)
    points = np.stack([np.interp(s, along, [place[k] for place in places]) for k in range(3)], axis=1)
    turns = np.linspace(turn_from, turn_to, n)
    return [_pose(point, float(turn), lean_deg) for point, turn in zip(points, turns, strict=True)]
