"""What a goal asks for, as joint vectors that are possible at all: within limits, free of the static layer and of the arm itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from common.errors import RequestError
from common.geometry.transforms import pose_matrix
from common.robot.model import RobotModel
from services.planner.core.check import Checker
from services.planner.core.inverse_kinematics import InverseKinematics
from services.planner.kernels.cells import Cells
from services.planner.kernels.collision import FREE

__all__ = ["GoalResolver"]

F64 = NDArray[np.float64]


class GoalResolver:
    """Turns joint vectors, tool poses and names into branches (B, J). Live cells do not matter here: they come and go."""

    def __init__(self, robot: RobotModel, checker: Checker, empty: Cells, named_rad: Mapping[str, Sequence[float]]) -> None:
        self._robot = robot
        self._checker = checker
        self._empty = empty
        self._named = {name: np.asarray(q, dtype=np.float64) for name, q in named_rad.items()} | {"home": robot.home_rad}
        self._inverse = InverseKinematics(robot)

    def joints(self, q_rad: F64, place: str = "q_rad") -> F64:
        """(1, J) of a joint vector.

        Raises:
            RequestError: wrong length, not finite, out of limits, in self-collision or in the static layer; names joint and value.
        """
        q = np.ascontiguousarray(q_rad, dtype=np.float64)
        violation = self._robot.limit_violation(q)
        if violation:
            raise RequestError(f"{place}: {violation}", code="out_of_limits")
        verdict, index = self._checker.pose(self._empty, q)
        if verdict != FREE:
            raise RequestError(f"{place}: {self._checker.describe(verdict, index)}", code="in_collision", facts={"q_rad": q.tolist()})
        return q[None]

    def name(self, name: str) -> F64:
        """(1, J) of a pose named in the config (``home`` is always there).

        Raises:
            RequestError: no such name, or what the name means is impossible.
        """
        if name not in self._named:
            raise RequestError(f"name: no pose is called {name!r}", code="unknown_name", facts={"known": sorted(self._named)})
        return self.joints(self._named[name], f"pose {name!r}")

    def pose(self, position_m: Sequence[float], quaternion_xyzw: Sequence[float]) -> F64:
        """(B, J) all inverse-kinematics branches of a tool pose that are possible, B >= 1.

        Raises:
            RequestError: malformed, out of reach, or every branch collides with the static layer or the arm itself.
        """
        for what, values, n in (("position_m", position_m, 3), ("quaternion_xyzw", quaternion_xyzw, 4)):
            if len(values) != n or not np.all(np.isfinite(values)):
                raise RequestError(f"pose.{what}: needs {n} finite numbers, got {list(values)!r}", code="bad_pose")
        if np.linalg.norm(quaternion_xyzw) < 1e-6:
            raise RequestError("pose.quaternion_xyzw: has no length", code="bad_pose")
        branches = self._inverse.solve(pose_matrix(position_m, quaternion_xyzw))
        if len(branches) == 0:
            raise RequestError(f"pose: {list(position_m)} is out of reach with that orientation", code="out_of_reach")
        verdicts = [self._checker.pose(self._empty, q) for q in branches]
        free = [q for q, (verdict, _) in zip(branches, verdicts, strict=True) if verdict == FREE]
        if not free:
            raise RequestError(f"pose: in all {len(branches)} ways {self._checker.describe(*verdicts[0])}", code="in_collision")
        return np.array(free)
