"""Training data of the map: reaching motions between a pick and a place region, half of them among random boxes.

One motion is drawn from one seed, ``SeedSequence(seed, spawn_key=(index,))``, and bounded by counts, so that motions can be made in any
order, by any number of processes, and again after an interruption, with the same result.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.errors import TolmanError
from services.planner.core.inverse_kinematics import InverseKinematics
from services.planner.core.rrt_connect import RrtConnect, RrtParameters
from services.planner.kernels.rrt_connect import World
from services.planner.offline.config import MotionsConfig, RegionConfig
from services.planner.offline.regions import box_cells, random_box, tool_pose_in
from services.planner.offline.scene import Scene

__all__ = ["MotionMaker", "Samples", "resample"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]
U64 = NDArray[np.uint64]

ATTEMPTS = 40  # draws of a motion until one is possible; measured: 1.3 on average
MAX_ITERATIONS = 600  # of RRTConnect; measured: 99 % of what 5000 solve, in a tenth of the time that failures cost
SHORTCUTS = 10  # a motion; measured: share of questions solved 0.91 with 60, 0.93 with 10: what is not yet taut covers more ways round
POSE_ATTEMPTS = 50  # draws of a tool pose until one can be reached
BOX_ATTEMPTS = 20  # draws of a box until one leaves start and goal free
ACROSS = 0.7  # our choice: share of motions from one region to the other; the rest stay in one or pass home
NEARBY = 0.5  # our choice: share of goals with the branch nearest to the start; the others take any, so that branches connect
BOX_SPREAD_M = 0.08  # our choice: standard deviation of a box's centre about the way of the tool


class MotionMaker:
    """Makes the motion of any index; not for two threads at once."""

    def __init__(self, scene: Scene, config: MotionsConfig) -> None:
        self.scene = scene
        self.config = config
        self._planner: RrtConnect = scene.planner(RrtParameters(max_iterations=MAX_ITERATIONS, shortcuts=SHORTCUTS))
        self._inverse = InverseKinematics(scene.robot)
        self._empty = scene.world(self._planner, np.empty(0, dtype=np.int32))

    def motion(self, index: int) -> F64:
        """The simplified path (P, J) of training motion ``index``.

        Raises:
            TolmanError: ``unreachable`` if none of many draws can be planned: regions that the arm does not reach.
        """
        sequence = np.random.SeedSequence(self.config.seed, spawn_key=(index,))
        rng = np.random.default_rng(sequence)
        state = sequence.spawn(1)[0].generate_state(4, np.uint64).astype(np.uint64)
        cluttered = rng.random() < self.config.cluttered
        for _ in range(ATTEMPTS):
            q_start, q_goal = self._ends(rng)
            cells = self.clutter(q_start, q_goal, rng) if cluttered else np.empty(0, dtype=np.int32)
            world = self.scene.world(self._planner, cells)
            path = self._planner.plan(world, q_start, q_goal, state)
            if path is not None:
                return self._planner.simplify(world, path, state)
        raise TolmanError(f"planner.motions: no motion {index} in {ATTEMPTS} draws between the regions", code="unreachable")

    def _ends(self, rng: np.random.Generator) -> tuple[F64, F64]:
        regions = [self.config.pick, self.config.place]
        if rng.random() < 0.5:
            regions.reverse()
        if rng.random() < ACROSS:
            return self._between(regions[0], regions[1], rng)
        if rng.random() < 0.5:
            return self._between(regions[0], regions[0], rng)
        home = self.scene.robot.home_rad
        q = self._between(regions[0], regions[0], rng)[0]
        return (home, q) if rng.random() < 0.5 else (q, home)

    def _between(self, region_a: RegionConfig, region_b: RegionConfig, rng: np.random.Generator) -> tuple[F64, F64]:
        starts, goals = self._branches(region_a, rng), self._branches(region_b, rng)
        start = starts[rng.integers(len(starts))]
        if rng.random() < NEARBY:
            return start, goals[np.argmin(np.linalg.norm(goals - start, axis=1))]
        return start, goals[rng.integers(len(goals))]

    def _branches(self, region: RegionConfig, rng: np.random.Generator) -> F64:
        """(n >= 1, J) free joint vectors of a random tool pose."""
        for _ in range(POSE_ATTEMPTS):
            found = self._inverse.solve(tool_pose_in(region, rng))
            free = [q for q in found if self._planner.is_free(self._empty, q)]
            if free:
                return np.array(free)
        raise TolmanError(
            f"planner.motions: no free joint vector in {POSE_ATTEMPTS} draws of a tool pose between {region.min_m} and {region.max_m}",
            code="unreachable",
        )

    def clutter(self, q_start: F64, q_goal: F64, rng: np.random.Generator) -> I32:
        """Cells of some boxes near the straight way of tool and elbow that leave start and goal free."""
        cells = np.empty(0, dtype=np.int32)
        for _ in range(rng.integers(1, self.config.boxes_max + 1)):
            for _ in range(BOX_ATTEMPTS):
                q = q_start + rng.random() * (q_goal - q_start)
                frames = self.scene.robot.joint_poses(q[None])[0]
                places = np.vstack([frames[len(frames) // 2 :, :3, 3], (frames[-1] @ self.scene.robot.T_joint_tool)[:3, 3]])
                centre = places[rng.integers(len(places))] + rng.normal(scale=BOX_SPREAD_M, size=3)
                box = box_cells(self.scene.grid, *random_box(centre, self.config.box_min_m, self.config.box_max_m, rng))
                world = self.scene.world(self._planner, box)
                if self._both_free(world, q_start, q_goal):
                    cells = np.union1d(cells, box).astype(np.int32)
                    break
        return cells

    def _both_free(self, world: World, q_start: F64, q_goal: F64) -> bool:
        return self._planner.is_free(world, q_start) and self._planner.is_free(world, q_goal)


@dataclass(frozen=True, eq=False)
class Samples:
    """Training samples ``q_rad`` (S, J) of T trajectories one after the other; trajectory t starts at row ``starts[t]``."""

    q_rad: F64
    starts: I64


def resample(paths: list[F64], n_samples: int) -> Samples:
    """All ``paths`` (P_t, J) at equal steps of joint distance, at least ``n_samples`` points in all and not many more.

    Raises:
        ValueError: no paths, or none of any length.
    """
    lengths = np.array([np.linalg.norm(np.diff(path, axis=0), axis=1).sum() for path in paths])
    if lengths.sum() <= 0.0:
        raise ValueError("no motion to sample from: every path is a point")
    fewest, step = 0.0, 2.0 * lengths.sum() / n_samples  # the largest step that still gives n_samples, by bisection
    for _ in range(60):
        middle = 0.5 * (fewest + step)
        if np.sum(np.ceil(lengths / middle) + 1) >= n_samples:
            fewest = middle
        else:
            step = middle
    counts = (np.ceil(lengths / fewest) + 1).astype(np.int64)
    q = np.concatenate([_at_equal_steps(path, n) for path, n in zip(paths, counts, strict=True)])
    return Samples(q, np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.int64))


def _at_equal_steps(path: F64, n_points: int) -> F64:
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    wanted = np.linspace(0.0, along[-1], n_points)
    return np.stack([np.interp(wanted, along, path[:, j]) for j in range(path.shape[1])], axis=1)
