"""Training motions for problems of a file: RRTConnect's for the scenes as they are, and for the same scenes moved at random.

Scenes of a set differ in where their things stand, so a motion through a scene says little about the next scene. Moved at random (turned
about the base's axis, shifted a little; the goal's tool pose moves along, any of its branches) one scene stands for many. An end that all
problems of a set share belongs to the arm, not to the scene, and stays.

One motion is drawn from one seed, of the problem's digest and the motion's number, and bounded by counts: motions of a problem do not
depend on which other problems there are, and maps that are trained on other problems of a file share them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from common.cell import CellConfig, SolidConfig
from common.geometry.transforms import rpy_matrix
from services.planner.config import MarginsConfig
from services.planner.core.arm import solids_of
from services.planner.core.inverse_kinematics import InverseKinematics
from services.planner.core.rrt_connect import RrtConnect, RrtParameters
from services.planner.core.world import no_cells
from services.planner.offline.config import ProblemsConfig
from services.planner.offline.problems import Problem
from services.planner.offline.scene import Scene

__all__ = ["ProblemMotionMaker", "ProblemOrder", "TrainingProblem", "training_problems"]

F64 = NDArray[np.float64]

MAX_ITERATIONS = 3000  # of RRTConnect; our choice: what takes longer leads through too narrow a place to be met often
SHORTCUTS = 10  # as for the motions of a cell
# Of the scene's field of distances, which serves one motion. Measured over 24 motions: filling it takes 1.4 s a scene with 1 cm, 0.03 s
# with 4 cm; the search takes 0.02 to 0.04 s.
FIELD_M = 0.04
MOVES = 8  # draws of a moved scene until one leaves both ends free; our choice


@dataclass(frozen=True, eq=False)
class TrainingProblem:
    """A problem, and whether its start and its goal move with the scene."""

    problem: Problem
    start_moves: bool
    goal_moves: bool

    @property
    def digest(self) -> str:
        """16 hex digits of all that its motions depend on."""
        p = self.problem
        content = [p.q_start.tolist(), p.q_goal.tolist(), msgspec.to_builtins(p.solids), self.start_moves, self.goal_moves]
        return hashlib.sha256(msgspec.msgpack.encode(content)).hexdigest()[:16]


def training_problems(problems: Sequence[Problem]) -> list[TrainingProblem]:
    """What moves with its scene is what not all problems of a set share; alone in its set, a problem keeps its start and moves its goal."""
    ends: dict[str, tuple[set[bytes], set[bytes]]] = {}
    for p in problems:
        starts, goals = ends.setdefault(p.set_name, (set(), set()))
        starts.add(p.q_start.tobytes())
        goals.add(p.q_goal.tobytes())
    moves = {name: (len(starts) > 1, len(goals) > 1 or len(starts) == 1) for name, (starts, goals) in ends.items()}
    return [TrainingProblem(p, *moves[p.set_name]) for p in problems]


@dataclass(frozen=True)
class ProblemOrder:
    """What is to be made, picklable for worker processes. ``fingerprint`` is of all that the motions depend on besides their problem."""

    cell: CellConfig
    margins: MarginsConfig
    config: ProblemsConfig
    problems: tuple[TrainingProblem, ...]
    directory: Path
    fingerprint: str

    @property
    def n_workers(self) -> int:
        """Processes that make the motions."""
        return self.config.n_workers

    @property
    def chunks(self) -> list[range]:
        """The indices of each problem's motions."""
        n = self.config.motions_per_problem
        return [range(k * n, (k + 1) * n) for k in range(len(self.problems))]

    def path(self, chunk: range) -> Path:
        """The file of a problem's motions."""
        return self.directory / f"problem-{self.problems[chunk.start // self.config.motions_per_problem].digest}.tolman"

    def maker(self) -> ProblemMotionMaker:
        """What makes them."""
        return ProblemMotionMaker(Scene.of(self.cell, self.margins), self.config, self.problems)


class ProblemMotionMaker:
    """Makes the motion of any index; not for two threads at once."""

    def __init__(self, scene: Scene, config: ProblemsConfig, problems: Sequence[TrainingProblem]) -> None:
        self.scene, self._config, self._problems = scene, config, problems
        self._nothing = no_cells(scene.grid)
        self._inverse = InverseKinematics(scene.robot)
        self._n_given = max(1, round((1.0 - config.random_share) * config.motions_per_problem))

    def motion(self, index: int) -> F64:
        """The simplified path (P, J) of training motion ``index``; (0, J) if none was found: the problem may have no solution."""
        number, k = divmod(index, self._config.motions_per_problem)
        training = self._problems[number]
        sequence = np.random.SeedSequence([self._config.seed, int(training.digest, 16), k])
        rng = np.random.default_rng(sequence)
        state = sequence.spawn(1)[0].generate_state(4, np.uint64).astype(np.uint64)
        for _ in range(1 if k < self._n_given else MOVES):
            moved = training.problem if k < self._n_given else self._moved(training, rng)
            if moved is None:
                continue
            planner = self._planner_among(moved.solids)
            world = planner.world(self._nothing, 0.0)
            if not (planner.is_free(world, moved.q_start) and planner.is_free(world, moved.q_goal)):
                continue
            path = planner.plan(world, moved.q_start, moved.q_goal, state)
            if path is not None:
                return planner.simplify(world, path, state)
            break  # another scene is another motion's
        return np.empty((0, self.scene.robot.n_joints))

    def moved(self, number: int, rng: np.random.Generator) -> Problem | None:
        """A training problem somewhere else, one after the other by ``number``; None if an end cannot be reached there."""
        return self._moved(self._problems[number % len(self._problems)], rng)

    def _planner_among(self, solids: tuple[SolidConfig, ...]) -> RrtConnect:
        """RRTConnect among the shapes themselves: one distance field answers what would be tens of thousands of cells."""
        scene, parameters = self.scene, RrtParameters(max_iterations=MAX_ITERATIONS, shortcuts=SHORTCUTS)
        low, high = scene.robot.position_min_rad, scene.robot.position_max_rad
        return RrtConnect(scene.arm, solids_of(solids, FIELD_M), low, high, parameters)

    def _moved(self, training: TrainingProblem, rng: np.random.Generator) -> Problem | None:
        """The same scene somewhere else; None if an end cannot be reached there."""
        p, c = training.problem, self._config
        T = self._move(rng.uniform(-c.turn_max_rad, c.turn_max_rad), rng.uniform(-c.shift_max_m, c.shift_max_m, size=3))
        q_start = self._branch(T, p.q_start, rng) if training.start_moves else p.q_start
        q_goal = self._branch(T, p.q_goal, rng) if training.goal_moves else p.q_goal
        if q_start is None or q_goal is None:
            return None
        return replace(p, q_start=q_start, q_goal=q_goal, solids=tuple(_moved_solid(T, solid) for solid in p.solids))

    def _move(self, turn_rad: float, shift_m: F64) -> F64:
        """4x4 in the world: a turn about the first joint's axis, then a shift."""
        chain = self.scene.robot.chain
        axis = chain.base_rotation @ chain.rotation[0] @ chain.axis[0]
        at = chain.base_rotation @ chain.translation[0] + chain.base_translation
        T = np.eye(4)
        T[:3, :3] = Rotation.from_rotvec(turn_rad * axis).as_matrix()
        T[:3, 3] = at - T[:3, :3] @ at + shift_m
        return T

    def _branch(self, T: F64, q_rad: F64, rng: np.random.Generator) -> F64 | None:
        """Any joint vector that puts the tool where ``q_rad`` has it, moved by ``T``."""
        found = self._inverse.solve(T @ self.scene.robot.tool_pose(q_rad))
        return found[rng.integers(len(found))] if len(found) else None


def _moved_solid(T: F64, solid: SolidConfig) -> SolidConfig:
    placed = T @ rpy_matrix(solid.position_m, solid.rpy_rad)
    x, y, z = placed[:3, 3].tolist()
    roll, pitch, yaw = Rotation.from_matrix(placed[:3, :3]).as_euler("xyz").tolist()
    return msgspec.structs.replace(solid, position_m=(x, y, z), rpy_rad=(roll, pitch, yaw))
