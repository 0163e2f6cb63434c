"""The motion under way as the planner knows it: what was sent, what the robot says of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from common.robot.trajectory import JointTrajectory
from services.planner.core.motion import Motion

__all__ = ["ArmState", "Sent", "Underway"]

F64 = NDArray[np.float64]
ACCEPT_WITHIN_S = 0.25  # a trajectory of which the robot has said nothing by then is lost; two status periods and some


@dataclass(frozen=True, eq=False)
class ArmState:
    """``robot/state`` on the planner's clock.

    Attributes:
        at_s: monotonic instant of the sample.
        q_reference_rad, dq_reference_rad_s: (J,) commanded.
        standing: the robot drives nothing (idle, holding, fault).
        mode, reason: the robot's words.
        trajectory_id, trajectory_time_s: the newest accepted trajectory, and how far along it the arm is.
        accepted_utc_ns: when it was accepted.
        refused_id: the newest trajectory that the robot refused since then; empty: none.
    """

    at_s: float
    q_reference_rad: F64
    dq_reference_rad_s: F64
    standing: bool
    mode: str
    reason: str
    trajectory_id: str
    trajectory_time_s: float
    accepted_utc_ns: int
    refused_id: str = ""


@dataclass(frozen=True, eq=False)
class Sent:
    """A trajectory that was sent.

    Attributes:
        id, kind: as sent.
        goal_id: what it is for.
        curve: the timed curve; its time 0 is ``start_s`` (monotonic).
        sent_s: when it was sent.
        motion: the motion it came from; None for a stop.
        q_goal: (J,) where it leads, None for a stop.
        rule: why it was planned.
        cause_utc_ns: publication of the first image of the frame that caused it, 0 if no frame did.
        splice: id and time of the trajectory that it leaves, None from rest.
    """

    id: str
    kind: Literal["motion", "stop"]
    goal_id: str
    curve: JointTrajectory
    start_s: float
    sent_s: float
    motion: Motion | None
    q_goal: F64 | None
    rule: str
    cause_utc_ns: int
    splice: tuple[str, float] | None


class Underway:
    """The newest trajectory that runs or is about to, and the one before it while the robot has not yet taken the new one."""

    def __init__(self) -> None:
        self.sent: Sent | None = None
        self._before: Sent | None = None
        self._accepted = False
        self.refused_reason = ""

    def send(self, sent: Sent) -> None:
        """A trajectory goes out."""
        self._before = self.sent if self._accepted else self._before
        self.sent, self._accepted = sent, False

    def hear(self, arm: ArmState, now_s: float) -> Sent | None:
        """Take the robot's word; returns the trajectory that has just been accepted, if one has."""
        newly = None
        if self.sent is not None and not self._accepted:
            if arm.trajectory_id == self.sent.id:
                self._accepted, self._before, self.refused_reason = True, None, ""
                newly = self.sent
            elif arm.refused_id == self.sent.id or now_s - self.sent.sent_s > ACCEPT_WITHIN_S:
                self.refused_reason = arm.reason or "the robot did not take the trajectory"
                self.sent, self._before = self._before, None
                self._accepted = self.sent is not None
        if self.sent is not None and self._accepted and arm.standing:
            given_up = arm.trajectory_id == self.sent.id or self._before is None
            if given_up:
                self.sent, self._accepted = None, False
        return newly

    def time_s(self, arm: ArmState, now_s: float) -> float:
        """Time along what is under way at ``now_s`` (negative: it waits for its start)."""
        assert self.sent is not None
        if self._accepted and arm.trajectory_id == self.sent.id:
            return min(arm.trajectory_time_s + (now_s - arm.at_s), self.sent.curve.duration_s)
        return now_s - self.sent.start_s

    def remaining(self, from_s: float) -> float:
        """Joint length in rad of what is under way from one of its times on."""
        assert self.sent is not None
        curve = self.sent.curve
        times = np.linspace(min(from_s, curve.duration_s), curve.duration_s, 60)
        return float(np.linalg.norm(np.diff(curve.sample(times)[0], axis=0), axis=1).sum())
