"""Can a problem be solved at all? RRTConnect of OMPL on the true shapes, coal on the bare meshes: no margin, no cells, no check of ours."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from ompl import base, geometric, util

from common.cell import SolidConfig
from common.geometry.transforms import rpy_matrix
from common.robot.kernels import Chain
from common.robot.model import RobotModel
from common.robot.pairs import coal_mesh
from services.planner.offline.problems import Problem

__all__ = ["Exact", "ExactPlanner", "TrueWorld"]

F64 = NDArray[np.float64]
RANGE_RAD = 2.0  # longest growth of a tree at a time; OMPL's default of a fifth of the space's extent is longer; our choice
STEP_RAD = 0.02  # between two poses of a motion, Euclidean: at most 2 cm at full reach; our choice


@dataclass(frozen=True, eq=False)
class Exact:
    """What RRTConnect says of a problem on its true shapes; ``path_rad`` (P, J) simplified, of a solved one."""

    outcome: Literal["solved", "start_blocked", "goal_blocked", "unsolved"]
    path_rad: F64 | None = None


class TrueWorld:
    """The arm among true shapes; one call into C++ a pose."""

    def __init__(self, robot: RobotModel, solids: tuple[SolidConfig, ...]) -> None:
        self._robot = robot
        self._model = _model(robot.chain)
        self._kinematics = self._model.createData()
        self._geometry = pin.GeometryModel()
        on_base = pin.SE3(robot.chain.base_rotation, robot.chain.base_translation)
        for body in robot.bodies:
            placed = pin.SE3.Identity() if body.joint else on_base
            self._geometry.addGeometryObject(pin.GeometryObject(body.name, body.joint, placed, coal_mesh(body)))
        for a, b in robot.pairs:
            self._geometry.addCollisionPair(pin.CollisionPair(int(a), int(b)))
        for solid in solids:
            placed = pin.SE3(rpy_matrix(solid.position_m, solid.rpy_rad))
            index = self._geometry.addGeometryObject(pin.GeometryObject(solid.name, 0, placed, _shape(solid)))
            for b, body in enumerate(robot.bodies):
                if not body.immobile:
                    self._geometry.addCollisionPair(pin.CollisionPair(b, index))
        self._data = self._geometry.createData()

    def is_free(self, q_rad: F64) -> bool:
        """Whether the pose ``q_rad`` (J,) is within limits and touches nothing."""
        if self._robot.limit_violation(q_rad):
            return False
        return not pin.computeCollisions(self._model, self._kinematics, self._geometry, self._data, q_rad, True)


class ExactPlanner:
    """OMPL's RRTConnect and its simplifier, for one arm."""

    def __init__(self, robot: RobotModel) -> None:
        util.setLogLevel(util.LogLevel.LOG_NONE)
        self._robot = robot
        bounds = base.RealVectorBounds(robot.n_joints)
        for j in range(robot.n_joints):
            bounds.setLow(j, float(robot.position_min_rad[j]))
            bounds.setHigh(j, float(robot.position_max_rad[j]))
        self._space = base.RealVectorStateSpace(robot.n_joints)
        self._space.setBounds(bounds)

    def solve(self, problem: Problem, limit_s: float, seed: int = 0) -> Exact:
        """The answer within ``limit_s`` of processor time; simplifying comes on top, at most as long again by the clock."""
        world = TrueWorld(self._robot, problem.solids)
        if not world.is_free(problem.q_start):
            return Exact("start_blocked")
        if not world.is_free(problem.q_goal):
            return Exact("goal_blocked")
        util.RNG.setSeed(seed + 1)  # 0 would mean: none
        space = base.SpaceInformation(self._space)
        space.setStateValidityChecker(_checker(world, self._robot.n_joints))
        space.setStateValidityCheckingResolution(STEP_RAD / self._space.getMaximumExtent())
        space.setup()
        definition = base.ProblemDefinition(space)
        definition.setStartAndGoalStates(self._state(problem.q_start), self._state(problem.q_goal))
        planner = geometric.RRTConnect(space)
        planner.setRange(RANGE_RAD)
        planner.setProblemDefinition(definition)
        planner.setup()
        began_s = time.thread_time()
        planner.solve(base.PlannerTerminationCondition(lambda: time.thread_time() - began_s > limit_s))
        if not definition.hasExactSolution():
            return Exact("unsolved")
        path = definition.getSolutionPath()
        raw = self._corners(path)
        is_valid = geometric.PathSimplifier(space).simplify(path, limit_s, True)
        return Exact("solved", self._corners(path) if is_valid else raw)

    def _state(self, q_rad: F64) -> Any:
        state = self._space.allocState()
        state[0 : len(q_rad)] = [float(value) for value in q_rad]
        return state

    def _corners(self, path: Any) -> F64:
        return np.array([state[0 : self._robot.n_joints] for state in path.getStates()])


def _checker(world: TrueWorld, n_joints: int) -> Callable[[Any], bool]:
    q, joints = np.empty(n_joints), range(n_joints)

    def is_valid(state: Any) -> bool:
        q[:] = [state[j] for j in joints]
        return world.is_free(q)

    return is_valid


def _model(chain: Chain) -> pin.Model:
    """A chain as pinocchio's model; its frame 0 is the world."""
    model, parent = pin.Model(), 0
    for j in range(len(chain.axis)):
        placed = pin.SE3(chain.rotation[j], chain.translation[j])
        if j == 0:
            placed = pin.SE3(chain.base_rotation, chain.base_translation) * placed
        kind = pin.JointModelPrismaticUnaligned if chain.prismatic[j] else pin.JointModelRevoluteUnaligned
        parent = model.addJoint(parent, kind(chain.axis[j]), placed, f"joint_{j + 1}")
    return model


def _shape(solid: SolidConfig) -> coal.CollisionGeometry:
    kinds = {"box": coal.Box, "cylinder": coal.Cylinder, "sphere": coal.Sphere}
    return kinds[solid.shape](*solid.size_m)
