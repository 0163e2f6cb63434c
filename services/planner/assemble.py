"""Puts the planner's parts together from a cell config and a built map."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

from common.cell import CellConfig
from common.geometry.grid import Grid
from common.robot.model import RobotModel
from common.robot.payload import Payload, with_payload
from services.planner.config import PlannerConfig
from services.planner.core.arm import arm_of, solids_of
from services.planner.core.burden import Burden, BurdenGround
from services.planner.core.check import Checker, HandReach
from services.planner.core.find import PathFinder
from services.planner.core.goals import GoalResolver
from services.planner.core.growth import Ground
from services.planner.core.motion import MotionPlanner
from services.planner.core.reflex import Reflex
from services.planner.core.roadmap import Roadmap
from services.planner.core.separation import Separation
from services.planner.core.timing import Limits
from services.planner.core.vision import Vision
from services.planner.core.world import no_cells
from services.planner.kernels.collision import Arm
from services.planner.kernels.reach import reach_of
from services.planner.kernels.separation import SpeedLaw
from services.planner.kernels.static_layer import Solids
from services.planner.offline.build import Built, Job, load_or_build
from services.planner.offline.finishing import layer_rules

__all__ = ["Load", "Parts", "assemble", "parts_of"]

Progress = Callable[[str, float], None]
SEPARATION_REACH_M = 0.15  # within it separations are measured by grids, beyond by the spheres that contain a body; our choice


@dataclass(frozen=True, eq=False)
class Load:
    """A box in the gripper, with all that it changes: the arm, what it adds to the map, how fast the arm may be near what is seen."""

    payload: Payload
    robot: RobotModel
    burden: Burden
    separation: Separation | None

    def on(self, roadmap: Roadmap) -> Load:
        """The same on a map that has grown."""
        return replace(self, burden=self.burden.on(roadmap))


@dataclass(frozen=True, eq=False)
class Parts:
    """Everything immutable that planners share; what has scratch is made per thread by the methods."""

    cell: CellConfig
    config: PlannerConfig
    robot: RobotModel
    grid: Grid
    roadmap: Roadmap
    built: Built
    separation: Separation | None = None  # how fast the arm may be near what is seen; None: as fast as it can

    @cached_property
    def arm(self) -> Arm:
        """The arm as the checks see it."""
        margins = self.config.margins
        return arm_of(self.robot, static_margin_m=margins.static_m, self_margin_m=margins.self_m)

    @cached_property
    def solids(self) -> Solids:
        """The static layer as the checks see it; its field of distances takes a third of a second."""
        return solids_of(self.cell.static)

    held: Payload | None = None  # what robot and roadmap reckon with

    def checker(self) -> Checker:
        """A new checker with its own scratch."""
        margins = self.config.margins
        return Checker(
            self.arm,
            self.solids,
            safety_m=margins.safety_m,
            step_m=margins.step_m,
            body_names=[body.name for body in self.robot.bodies],
            solid_names=[solid.name for solid in self.cell.static],
        )

    @property
    def ground(self) -> Ground:
        """What the rows of the table depend on."""
        margins = self.config.margins
        return Ground(self.arm, self.grid, margins.safety_m, margins.edge_step_m, layer_rules(self.arm, self.grid, self.config))

    def on(self, roadmap: Roadmap) -> Parts:
        """The same with another roadmap: one that has grown."""
        return replace(self, roadmap=roadmap)

    def load(self, payload: Payload) -> Load:
        """Of the bare arm's: what a box in the gripper changes. Takes seconds.

        Raises:
            RequestError: the box cannot be held.
        """
        held = self._with(with_payload(self.robot, payload), payload)
        burden = Burden.of(self.roadmap, BurdenGround.of(held.ground, self.solids))
        return Load(payload, held.robot, burden, None if self.separation is None else _separation(held.arm, self.config))

    def holding(self, load: Load) -> Parts:
        """Of the bare arm's: the same with a box in the gripper, whose ``load`` was made for this map."""
        return replace(self._with(load.robot, load.payload), roadmap=load.burden.joined(self.roadmap), separation=load.separation)

    def _with(self, robot: RobotModel, payload: Payload) -> Parts:
        """The same with another arm; its roadmap is not yet for it."""
        parts = replace(self, robot=robot, held=payload)
        vars(parts)["solids"] = self.solids  # not the arm's
        return parts

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
        weighs = self.config.clearance.weight > 0.0 and self.roadmap.table.layers.n_bands > 0  # maps of benchmarks have no layers
        finder = PathFinder(self.roadmap, self.checker(), self.config.clearance.surcharges if weighs else ())
        joint_range = (self.robot.position_min_rad, self.robot.position_max_rad)
        smoothing = self.config.smoothing
        return MotionPlanner(
            finder,
            limits,
            self.hand,
            joint_range,
            shortcut_checks=smoothing.shortcut_checks,
            refine_looks=smoothing.refine_looks,
            separation=self.separation,
        )

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
    return parts_of(job, load_or_build(job, progress))


def parts_of(job: Job, built: Built) -> Parts:
    """The parts of a job whose map is there."""
    roadmap = Roadmap.of(built.learned, built.table, job.config.model)
    return Parts(job.cell, job.config, job.scene.robot, job.scene.grid, roadmap, built, _separation(job.scene.arm, job.config))


def _separation(arm: Arm, config: PlannerConfig) -> Separation | None:
    if not config.separation.slow:
        return None
    standing = SpeedLaw(0.0, 0.0, config.separation.braking_m_s2, config.separation.reduced_speed_m_s)
    moving = standing._replace(person_m_s=config.replan.hand_speed_m_s, reaction_s=config.replan.hand_seen_s)
    return Separation(arm, reach_of(arm.grids, SEPARATION_REACH_M), standing, moving)
