"""The section ``[robot_sim]`` of a cell config."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from common.config import Strict

__all__ = ["ExecutorConfig", "GuideConfig", "RobotSimConfig", "WatchdogConfig"]

Positive = Annotated[float, Meta(gt=0)]
Share = Annotated[float, Meta(ge=0, le=0.1)]


class ExecutorConfig(Strict, frozen=True):
    """What a trajectory must be to move the arm."""

    # Time-optimal curves touch their limits, and a Hermite curve through sampled knots overshoots them a little between. Our choice.
    limit_tolerance: Share = 0.01
    # A jump of the reference by 1e-6 rad within one 8 ms cycle looks like 0.016 rad/s2, 0.3 % of the UR3's limit. Our choice.
    splice_position_rad: Positive = 1e-6
    # Slower than this counts as rest (the planner's own bound too); as a step within one cycle 0.125 rad/s2, 2.5 % of the UR3's limit.
    splice_velocity_rad_s: Positive = 1e-3
    start_late_max_s: Positive = 0.25  # our choice: an older order belongs to a past that nobody remembers
    start_ahead_max_s: Positive = 10.0  # our choice
    max_knots: Annotated[int, Meta(ge=2)] = 5000  # our choice: bounds what one message may cost in a control cycle


class WatchdogConfig(Strict, frozen=True):
    """When the arm counts as blind or headless."""

    status_timeout_s: Positive = 0.25  # issue 2, design: safety of the moving arm
    exposure_timeout_s: Positive = 0.25  # likewise


class GuideConfig(Strict, frozen=True):
    """The hand that guides the arm, and how the arm yields to it."""

    speed_max_m_s: Positive = 0.25  # issue: hands move at 0.25 m/s; also what ISO 10218-1 allows for a guided arm
    turn_speed_rad_s: Positive = 1.0  # of the hand; our choice
    duration_max_s: Annotated[float, Meta(gt=0, le=90)] = 60.0  # our choice; with its settling within executor.max_knots
    pull_per_s: Positive = 4.0  # the tool goes after the hand so fast a metre that it is behind: 6 cm at 0.25 m/s; our choice
    damping: Positive = 0.02  # of the least squares, in metres and radians: near a singular pose the tool gives way instead; our choice
    velocity_share: Annotated[float, Meta(gt=0, le=1)] = 0.5  # of the arm's limits; our choice: a person holds it
    acceleration_share: Annotated[float, Meta(gt=0, le=1)] = 0.5
    lag_max_m: Positive = 0.15  # a tool farther behind is not in the hand any more; our choice
    lag_max_rad: Positive = 1.0
    near_m: Positive = 0.002  # where the hand ends the tool is so near when the arm comes to rest; our choice
    near_rad: Positive = 0.01
    settle_s: Positive = 4.0  # time for that; our choice


class RobotSimConfig(Strict, frozen=True):
    """Physics, executor, watchdog and manners of the simulated cell."""

    control_hz: Annotated[float, Meta(ge=20, le=1000)] = 125.0  # protocol: robot/state
    physics_substeps: Annotated[int, Meta(ge=1, le=20)] = 2  # 250 Hz; measured: 80 us a step
    scene_hz: Positive = 30.0  # protocol: robot/scene
    clearance_hz: Positive = 25.0  # our choice: at 0.25 m/s a hand moves 1 cm between two looks
    clearance_reach_m: Positive = 0.3  # our choice: farther things are not looked at but on robot/clearance
    politeness_gap_m: Annotated[float, Meta(ge=0)] = 0.03  # design: hands wait 3 cm from an arm that stands ...
    politeness_room_m: Annotated[float, Meta(ge=0)] = 0.10  # ... until it has gone so far, not as soon as it starts; our choice
    standing_rad_s: Positive = 0.02  # protocol: terms
    contact_gap_s: Positive = 0.5  # protocol: terms
    caused_speed_m_s: Positive = 0.01  # protocol: terms
    tracking_fault_rad: Positive = 0.2  # our choice: ten times the error that is accepted; the arm is jammed
    max_obstacles: Annotated[int, Meta(ge=1)] = 64  # our choice
    watchdog: bool = True  # off only where robot_sim runs alone (tests)
    executor: ExecutorConfig = ExecutorConfig()
    watchdog_limits: WatchdogConfig = WatchdogConfig()
    guide: GuideConfig = GuideConfig()
