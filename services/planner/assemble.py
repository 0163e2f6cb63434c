"""Puts the planner's parts together from a cell config and a built map."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from common.cell import CellConfig
from common.geometry.grid import Grid
from common.robot.model import RobotModel
from common.robot.payload import Payload, with_payload
from services.planner.config import PlannerConfig
from services.planner.core.arm import arm_of, solids_of
from services.planner.core.burden import burdened
from services.planner.core.check import Checker, HandReach
from services.planner.core.find import PathFinder
from services.planner.core.goals import GoalResolver
from services.planner.core.growth import Ground
from services.planner.core.motion import MotionPlanner
from services.planner.core.reflex import Reflex
from services.planner.core.roadmap import Roadmap
from services.planner.core.timing import Limits
from services.planner.core.vision import Vision
from services.planner.core.world import no_cells
from services.planner.offline.build import Built, Job, load_or_build

__all__ = ["Parts", "assemble"]

Progress = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class Parts:
    """Everything immutable that planners share; what has scratch is made per thread by the methods."""

    cell: CellConfig
    config: PlannerConfig
    robot: RobotModel
    grid: Grid
    roadmap: Roadmap
    built: Built
    held: Payload | None = None  # what robot and roadmap reckon with

    def checker(self) -> Checker:
        """A new checker with its own scratch."""
        margins = self.config.margins
        return Checker(
            arm_of(self.robot, static_margin_m=margins.static_m, self_margin_m=margins.self_m),
            solids_of(self.cell.static),
            safety_m=margins.safety_m,
            step_m=margins.step_m,
            body_names=[body.name for body in self.robot.bodies],
            solid_names=[solid.name for solid in self.cell.static],
        )

    @property
    def ground(self) -> Ground:
        """What the rows of the table depend on."""
        margins = self.config.margins
        arm = arm_of(self.robot, static_margin_m=margins.static_m, self_margin_m=margins.self_m)
        return Ground(arm, self.grid, margins.safety_m, margins.step_m)

    def on(self, roadmap: Roadmap) -> Parts:
        """The same with another roadmap: one that has grown."""
        return replace(self, roadmap=roadmap)

    def holding(self, payload: Payload) -> Parts:
        """Of the bare arm's: the same with a box in the gripper. Takes seconds.

        Raises:
            RequestError: the box cannot be held.
        """
        held = replace(self, robot=with_payload(self.robot, payload), held=payload)
        return replace(held, roadmap=burdened(self.roadmap, held.ground, solids_of(self.cell.static)))

    @property
    def limits(self) -> Limits:
        """The arm's own limits; stops may use them in full."""
        return Limits(self.robot.max_velocity_rad_s, self.robot.max_acceleration_rad_s2)

    @property
    def hand(self) -> HandReach:
        """What a hand may do while the arm comes to rest."""
        replan = self.config.replan
        return HandReach(replan.hand_speed_m_s, replan.hand_seen_s, self.robot.max_acceleration_rad_s2)

    def motion_planner(self) -> MotionPlanner:
        """A new planner with its own scratch, at the configured share of the limits."""
        limits = self.limits.scaled(self.config.speed.velocity, self.config.speed.acceleration)
        finder = PathFinder(self.roadmap, self.checker())
        joint_range = (self.robot.position_min_rad, self.robot.position_max_rad)
        return MotionPlanner(finder, limits, self.hand, joint_range, shortcut_checks=self.config.smoothing.shortcut_checks)

    def goal_resolver(self) -> GoalResolver:
        """A new resolver with its own scratch."""
        return GoalResolver(self.robot, self.checker(), no_cells(self.grid), self.cell.poses)

    def reflex(self, clock_ns: Callable[[], int], name: str) -> Reflex:
        """The live planner."""
        vision = Vision(self.grid, self.roadmap, unavoidable_frames=self.config.replan.unavoidable_frames)
        return Reflex(self.motion_planner(), vision, self.limits, self.config, clock_ns, name)

    @property
    def fingerprints(self) -> dict[str, str]:
        """For ``planner/info``."""
        return {**self.built.fingerprints, "grid_cells": self.grid.fingerprint, "map_sha256": self.built.sha256}


def assemble(cell: CellConfig, config: PlannerConfig, progress: Progress = lambda _stage, _share: None) -> Parts:
    """Load the robot and the map (built first where it is missing).

    Raises:
        TolmanError: robot or map cannot be had.
    """
    job = Job.of(cell, config)
    built = load_or_build(job, progress)
    roadmap = Roadmap.of(built.learned, built.table, config.model)
    return Parts(cell, config, job.scene.robot, job.scene.grid, roadmap, built)
