"""The executor: which reference the joints follow at each instant, whatever the planner sends.

Pure: instants are arguments (monotonic nanoseconds). The reference keeps the limits on position, velocity and acceleration for any
stream of trajectories, stops and losses of the senses, because only admitted curves are driven and braking stays on them. Only
:meth:`Executor.reset`, a teleport of the simulated arm, is no motion.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from common.robot.braking import brake_along
from services.robot_sim.config import ExecutorConfig
from services.robot_sim.core.admission import Motion, admit
from services.robot_sim.core.limits import Limits
from services.robot_sim.core.timeline import NS, Segment, Timeline

__all__ = ["Cause", "Executor", "Status"]

F64 = NDArray[np.float64]
GUIDED = "guided by hand"
Mode = Literal["idle", "tracking", "holding", "stopping", "fault"]


class Cause(IntEnum):
    """Why the arm brakes or holds; a stronger cause replaces a weaker one, not the other way round."""

    NONE = 0
    PLANNER = 1  # a stop trajectory: the next motion ends it
    SENSES = 2  # the watchdog: ends by itself when the senses are back
    COMMAND = 3  # robot/stop: ends by robot/resume
    FAULT = 4  # the arm does not follow: ends by robot/resume or robot/reset


@dataclass(frozen=True)
class Status:
    """For ``robot/state``.

    Attributes:
        trajectory_id: the newest accepted trajectory, also while it waits for its takeover; empty before the first and after a reset.
        trajectory_time_s: how far along it the arm is: negative while it waits, at most its duration. While braking it advances
            with the path, so that it always names a place on the curve.
        refused_id: the newest refused trajectory since the newest accepted one; empty: none.
    """

    mode: Mode
    reason: str
    trajectory_id: str
    trajectory_time_s: float
    refused_id: str


@dataclass(frozen=True, eq=False)
class _Braking:
    """The brake since the newest trajectory: its path time 0 is ``begin_ns`` on the timeline that it replaced."""

    begin_ns: int
    t_s: F64
    path_time_s: F64


class Executor:
    """Holds the timeline, admits trajectories, brakes."""

    def __init__(self, limits: Limits, config: ExecutorConfig, q_rad: F64, now_ns: int) -> None:
        self._limits = limits
        self._config = config
        self.reset(q_rad, now_ns)

    def reset(self, q_rad: F64, now_ns: int) -> None:
        """Stand at ``q_rad`` (J,) and forget everything: causes, trajectories, refusals."""
        self._now_ns = now_ns
        self._timeline = Timeline.standing(q_rad, now_ns)
        self._newest: Segment | None = None
        self._braking: _Braking | None = None
        self._cause = Cause.NONE
        self._reason = ""
        self._lost = ""
        self._refusal = self._refused_id = ""
        self._guide_id = ""

    @property
    def guided(self) -> bool:
        """Whether a hand leads the arm, or led it and it still brakes."""
        return self.moving and bool(self._guide_id) and self._newest is not None and self._newest.id == self._guide_id

    @property
    def moving(self) -> bool:
        """Whether anything is still to be driven, a trajectory that waits for its start included."""
        return self._now_ns < self._timeline.end_ns

    def submit(self, motion: Motion) -> str | None:
        """Take a trajectory, or refuse it and say why; a refusal never moves the arm."""
        refusal = self._refuse_by_state()
        if refusal is None:
            segment = admit(motion, self._timeline, self._now_ns, self._limits, self._config)
            if isinstance(segment, Segment):
                self._timeline = self._timeline.with_segment(segment)
                self._newest, self._braking = segment, None
                self._cause, self._reason = Cause.NONE, ""
                self._refusal = self._refused_id = ""
                return None
            refusal = segment
        return self.refuse(motion.id, refusal)

    def refuse(self, motion_id: str, why: str) -> str:
        """Refuse a trajectory for a reason that lies outside of it; says it in the status and returns it."""
        self._refused_id = motion_id
        self._refusal = f"refused {motion_id[:64]!r}: {why}"
        return why

    def guide(self, motion: Motion) -> str | None:
        """A hand takes the tool and leads the arm along ``motion``; refused, like a trajectory, and also while anything is driven.

        Until it ends no trajectory is taken; :meth:`release` and :meth:`stop` end it.
        """
        if self.moving:
            return f"the arm drives {self._timeline.newest.id[:64]!r}"
        refusal = self.submit(motion)
        if refusal is None:
            self._guide_id = motion.id
        return refusal

    def release(self) -> None:
        """The hand lets go: brake along the path; the next trajectory is taken."""
        if self.guided:
            self.stop("the hand let go", Cause.PLANNER)

    def stop(self, reason: str, cause: Cause = Cause.COMMAND) -> None:
        """Brake along the path if moving, then hold; no trajectory is taken until the cause is gone."""
        if cause >= self._cause:
            self._cause, self._reason = cause, reason
        if self.moving and self._braking is None:
            brake = brake_along(self._timeline.remaining(self._now_ns), self._limits.max_acceleration_rad_s2)
            self._braking = _Braking(self._now_ns, brake.curve.t_s, brake.path_time_s)
            self._timeline = Timeline((Segment("", "motion", brake.curve, self._now_ns, self._now_ns),))

    def resume(self) -> None:
        """Take back a stop by command or a fault; the arm stays where it is and takes trajectories again."""
        self._cause, self._reason, self._refusal = Cause.NONE, "", ""

    def tick(self, now_ns: int, lost: str) -> None:
        """Decide for the cycle that ends at ``now_ns``; ``lost`` says what the watchdog misses, empty if nothing.

        A brake begins at the last instant that was given out, so that the reference has no gap.
        """
        self._lost = lost
        if lost and self.moving:
            self.stop(lost, Cause.SENSES)
        self._timeline = self._timeline.since(self._now_ns)  # of what drives in this cycle nothing is dropped
        self._now_ns = now_ns
        if self.moving:
            return
        if self._cause == Cause.SENSES and not lost:
            self._cause, self._reason = Cause.NONE, ""
        if self._cause == Cause.NONE and self._timeline.newest.kind == "stop":
            self._cause, self._reason = Cause.PLANNER, "stopped by the planner"

    def later(self, by_ns: int) -> None:
        """The machine lost time: everything happens ``by_ns`` later, so that the reference does not jump."""
        self._timeline = self._timeline.later(by_ns)
        self._now_ns += by_ns
        self._newest = None if self._newest is None else replace(self._newest, start_ns=self._newest.start_ns + by_ns)
        self._braking = None if self._braking is None else replace(self._braking, begin_ns=self._braking.begin_ns + by_ns)

    def reference(self, at_ns: int) -> tuple[F64, F64]:
        """Commanded position and velocity (J,) at an instant; ask only between the last two ticks."""
        return self._timeline.state(at_ns)

    def status(self) -> Status:
        """Mode, reason and progress at the last tick."""
        newest_id, time_s = self._progress()
        reason = self._reason or self._lost or (GUIDED if self.guided else "")
        return Status(self._mode(), "; ".join(r for r in (reason, self._refusal) if r), newest_id, time_s, self._refused_id)

    def _refuse_by_state(self) -> str | None:
        if self._cause in (Cause.COMMAND, Cause.FAULT):
            return f"{self._reason} (robot/resume ends that)"
        if self._lost:
            return self._lost
        if self.guided:
            return f"the arm is {GUIDED}"
        return "the arm is braking" if self.moving and self._braking is not None else None

    def _progress(self) -> tuple[str, float]:
        if self._newest is None:
            return "", 0.0
        at_ns = self._now_ns
        if self._braking is not None:
            driven_s = (self._now_ns - self._braking.begin_ns) / NS
            at_ns = self._braking.begin_ns + round(float(np.interp(driven_s, self._braking.t_s, self._braking.path_time_s)) * NS)
        return self._newest.id, min((at_ns - self._newest.start_ns) / NS, self._newest.curve.duration_s)

    def _mode(self) -> Mode:
        if self.moving:
            stopping = self._braking is not None or self._timeline.active(self._now_ns).kind == "stop"
            return "stopping" if stopping else "tracking"
        if self._cause == Cause.FAULT:
            return "fault"
        return "idle" if self._cause == Cause.NONE else "holding"
