"""RRTConnect for one arm: the source of training motions, and the fallback when the map has no answer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.planner.kernels import rrt_connect as kernel
from services.planner.kernels.cells import Cells
from services.planner.kernels.collision import Arm, pose_is_free
from services.planner.kernels.static_layer import Solids

__all__ = ["RrtConnect", "RrtParameters"]

F64 = NDArray[np.float64]
U64 = NDArray[np.uint64]

MAX_POINTS = 1024  # of a path; our choice, far above what is needed


@dataclass(frozen=True)
class RrtParameters:
    """``range_rad``: longest growth of a tree at a time; ``step_rad``: poses of a motion are checked at most so far apart."""

    range_rad: float = 1.0  # measured: 0.5 to 2 make little difference
    step_rad: float = 0.03  # our choice: about 2 cm at full reach, less than the safety distance
    max_iterations: int = 5000  # our choice: about a second in a tight scene
    max_nodes: int = 20_000
    shortcuts: int = 60  # our choice


class RrtConnect:
    """A planner with its own scratch, for one thread.

    Args:
        arm, solids: the arm and the static layer.
        q_min_rad, q_max_rad: (J,) the box that is searched.
    """

    def __init__(self, arm: Arm, solids: Solids, q_min_rad: F64, q_max_rad: F64, parameters: RrtParameters | None = None) -> None:
        self.parameters = parameters or RrtParameters()
        self._arm, self._solids = arm, solids
        self._q_min, self._q_max = np.asarray(q_min_rad, dtype=np.float64), np.asarray(q_max_rad, dtype=np.float64)
        n_joints, n_nodes = len(self._q_min), self.parameters.max_nodes
        self._scratch = (np.empty((n_joints + 1, 3, 3)), np.empty((n_joints + 1, 3)), np.empty(n_joints))
        self._trees = kernel.Trees(np.empty((2, n_nodes, n_joints)), np.empty((2, n_nodes), dtype=np.int32), np.empty(2, dtype=np.int32))
        self._path = np.empty((MAX_POINTS, n_joints))

    def world(self, cells: Cells, safety_m: float) -> kernel.World:
        """What motions among ``cells`` are checked against; lives as long as this planner."""
        return kernel.World(self._arm, self._solids, cells, float(safety_m), *self._scratch)

    def is_free(self, world: kernel.World, q_rad: F64) -> bool:
        """Whether the pose ``q_rad`` (J,) hits nothing."""
        return bool(pose_is_free(world.arm, world.solids, world.cells, world.safety_m, q_rad, world.rotation, world.translation))

    def plan(self, world: kernel.World, q_start_rad: F64, q_goal_rad: F64, rng: U64) -> F64 | None:
        """A free path (P, J) from start to goal, or None if either is not free or none was found.

        ``rng`` (4,) uint64 is the generator's state, advanced here: equal states give equal paths.
        """
        start, goal = np.ascontiguousarray(q_start_rad, dtype=np.float64), np.ascontiguousarray(q_goal_rad, dtype=np.float64)
        if not (self.is_free(world, start) and self.is_free(world, goal)):
            return None
        p = self.parameters
        n = kernel.grow_until_joined(
            world, self._trees, start, goal, self._q_min, self._q_max, p.range_rad, p.step_rad, p.max_iterations, rng, self._path
        )
        return self._path[:n].copy() if n else None

    def simplify(self, world: kernel.World, path_rad: F64, rng: U64) -> F64:
        """A shorter free path (P', J) with the same ends, by ``shortcuts`` random attempts."""
        n = len(path_rad)
        self._path[:n] = path_rad
        n = kernel.shortcut(world, self._path, n, self.parameters.shortcuts, self.parameters.step_rad, rng)
        return self._path[:n].copy()
