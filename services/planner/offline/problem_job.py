"""What is to be built for the problems of a file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from common.cell import CellConfig
from services.planner.config import PlannerConfig
from services.planner.offline.build import Job
from services.planner.offline.problem_cell import problem_cell
from services.planner.offline.problem_motions import training_problems
from services.planner.offline.problems import read_problems

__all__ = ["problem_job"]


def problem_job(cell: CellConfig, config: PlannerConfig, path: Path, recorded: Sequence[Path] = (), extension: Sequence[Path] = ()) -> Job:
    """The map of all problems of a file, in their own cell (:mod:`services.planner.offline.problem_cell`).

    Args:
        cell, config: of the arm; ``[planner.problems]`` says the rest.
        path: of the problems.
        recorded, extension: as for :meth:`services.planner.offline.build.Job.of`.

    Raises:
        RobotError: the robot cannot be loaded.
        ConfigError: the file of problems or of a motion cannot be used.
    """
    job = Job.of(*problem_cell(cell, config), recorded, extension=extension)
    robot = job.cell.robot
    problems = read_problems(path, job.scene.robot.joint_names, (robot.base_position_m, robot.base_rpy_rad))
    return job.on(training_problems(problems))
