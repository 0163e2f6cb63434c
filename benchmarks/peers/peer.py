"""What every peer looks like from outside, and what all of them are given."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from benchmarks.questions import Question
from common.cell import CellConfig, SolidConfig
from common.geometry.grid import Grid
from common.robot.model import RobotModel, load_robot
from services.planner.assemble import Parts
from services.planner.config import MarginsConfig

__all__ = ["STEP_RAD", "TIME_LIMIT_S", "Peer", "PeerAnswer", "Setting", "Watch", "path_length_rad"]

F64 = NDArray[np.float64]

STEP_RAD = 0.03  # poses of a motion are checked at most so far apart (Euclidean in joint space); as our RRTConnect does
TIME_LIMIT_S = 5.0  # issue: solvable means RRTConnect solves it in 5 s


@dataclass(frozen=True, eq=False)
class Setting:
    """What does not change between questions: arm, grid, static layer and the distances that a motion keeps."""

    robot: RobotModel
    grid: Grid
    static: Sequence[SolidConfig]
    margins: MarginsConfig

    @staticmethod
    def of(cell: CellConfig, margins: MarginsConfig) -> Setting:
        """The setting of a cell config.

        Raises:
            RobotError: the robot cannot be loaded.
        """
        return Setting(load_robot(cell.robot), Grid.of(cell.grid), cell.static, margins)

    @staticmethod
    def of_parts(parts: Parts) -> Setting:
        """The setting that an assembled planner of ours works in."""
        return Setting(parts.robot, parts.grid, parts.cell.static, parts.config.margins)


@dataclass(frozen=True, eq=False)
class PeerAnswer:
    """What a peer made of one question.

    Attributes:
        path_rad: (P, J) corners of the path, simplified if that was asked for; None if there is none.
        raw_rad: (P', J) the path before it was simplified.
        seconds: ``world`` (taking in the changed cells), ``plan``, ``simplify``, ``total``; 0 for what was not done.
        reason: why there is no path, else empty.
    """

    path_rad: F64 | None
    raw_rad: F64 | None
    seconds: dict[str, float]
    reason: str = ""


class Peer(Protocol):
    """A planner of others. Keeps nothing of one question for the next but what :meth:`prepare` made."""

    name: str

    def prepare(self) -> None:
        """Everything that is done once per arm and takes no part in the times. :meth:`solve` calls it if nobody did."""

    def solve(self, question: Question, time_limit_s: float = TIME_LIMIT_S, seed: int = 0, simplify: bool = True) -> PeerAnswer:
        """Take in the question's cells, plan, simplify. A plan that takes longer than ``time_limit_s`` counts as none."""


class Watch:
    """Seconds of a peer's steps, each from the end of the last one, and in all."""

    def __init__(self) -> None:
        self._seconds = {"world": 0.0, "plan": 0.0, "simplify": 0.0}
        self._began = self._last = time.perf_counter()

    def lap(self, step: str) -> float:
        """A step has ended; what it took."""
        now = time.perf_counter()
        self._seconds[step], self._last = now - self._last, now
        return self._seconds[step]

    def seconds(self) -> dict[str, float]:
        """All steps so far, and ``total``."""
        return {**self._seconds, "total": self._last - self._began}


def path_length_rad(path_rad: F64) -> float:
    """Length of a path (P, J), Euclidean in joint space."""
    return float(np.linalg.norm(np.diff(path_rad, axis=0), axis=1).sum())
