"""The replan rules as one pure state machine; time is an argument.

A new way is taken (Steffen et al. 2022, section IV) if there is none, if the one under way is blocked, or if another is shorter and stays
so for a time. Here it is decided *what to do now*; how is :mod:`services.planner.core.reflex`'s business.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

__all__ = ["Action", "ReplanRules", "ShorterWay", "View"]

F64 = NDArray[np.float64]


class Action(Enum):
    """What the rules ask for."""

    NOTHING = "nothing"
    PLAN = "plan"  # rule "none": there is a goal and no way under way
    DODGE = "dodge"  # rule "blocked": what is ahead is blocked
    COMPARE = "compare"  # rule "shorter": look whether there is a shorter way
    STOP = "stop"  # come to rest on the way under way
    ARRIVED = "arrived"


@dataclass(frozen=True)
class View:
    """What the rules look at.

    Attributes:
        now_s: monotonic time.
        has_goal: there is a goal.
        seeing: perception is fresh.
        moving: a motion is under way (sent, and neither finished nor given up by the robot).
        stopping: what is under way is a stop.
        at_goal: the arm stands at the goal.
        to_other_goal: the motion under way leads to another goal than the present one.
        blocked_in_s: time until the arm reaches the first blocked point of what is under way; None: free.
        stop_needs_s: time needed to stand before a blocked point, margin included.
        cells_changed: this step brought a change of cells.
        protective: why the arm must stand whatever the map says; empty if nothing.
        faulted: the robot is in fault and takes nothing until somebody resumes it.
    """

    now_s: float
    has_goal: bool
    seeing: bool
    moving: bool
    stopping: bool
    at_goal: bool
    to_other_goal: bool
    blocked_in_s: float | None
    stop_needs_s: float
    cells_changed: bool
    protective: str
    faulted: bool = False

    @property
    def may_plan_from_rest(self) -> bool:
        """Whether a motion may be sent to an arm that stands."""
        return self.has_goal and self.seeing and not (self.moving or self.at_goal or self.protective or self.faulted)


class ReplanRules:
    """Decides. State: when the last attempt was, so that attempts come at each tick and at each change of cells, not in every step."""

    def __init__(self, tick_s: float) -> None:
        self._tick_s = tick_s
        self._last_s = -np.inf

    def decide(self, view: View) -> Action:
        """The action for this step."""
        if view.faulted:
            return Action.NOTHING
        if view.moving and not view.stopping and (view.protective or not view.has_goal):
            return Action.STOP
        if not view.has_goal or view.protective:
            return Action.NOTHING
        if view.at_goal and not view.moving:
            return Action.ARRIVED
        if not view.seeing:
            return Action.NOTHING  # the executor's own watchdog brakes; a plan on old cells would be a guess
        if view.moving and (view.stopping or view.blocked_in_s is not None or view.to_other_goal):
            return self._when_moving(view)
        due = view.now_s - self._last_s >= self._tick_s
        if not view.moving:
            return self._attempt(view, Action.PLAN) if due or view.cells_changed else Action.NOTHING
        return self._attempt(view, Action.COMPARE) if due else Action.NOTHING

    def _when_moving(self, view: View) -> Action:
        if view.stopping:
            return Action.NOTHING  # plan when the arm stands
        urgent = view.blocked_in_s is not None and view.blocked_in_s <= view.stop_needs_s
        if view.cells_changed or view.to_other_goal or view.now_s - self._last_s >= self._tick_s:
            return self._attempt(view, Action.DODGE)
        return Action.STOP if urgent else Action.NOTHING

    def after_failed_dodge(self, view: View) -> Action:
        """No way round was found: stop if the blocked point is near, else go on and try again."""
        if view.to_other_goal or (view.blocked_in_s is not None and view.blocked_in_s <= view.stop_needs_s):
            return Action.STOP
        return Action.NOTHING

    def now_or_never(self) -> None:
        """Forget the last attempt: the next step may plan at once (new goal, arm came to rest)."""
        self._last_s = -np.inf

    def _attempt(self, view: View, action: Action) -> Action:
        self._last_s = view.now_s
        return action


class ShorterWay:
    """Tells when a shorter way has been there long enough, along the same corridor."""

    def __init__(self, *, share: float, least_rad: float, stable_s: float, corridor_rad: float) -> None:
        self._share, self._least_rad, self._stable_s, self._corridor_rad = share, least_rad, stable_s, corridor_rad
        self.forget()

    def forget(self) -> None:
        """No candidate any more."""
        self._since_s: float | None = None
        self._middle: F64 | None = None

    def offer(self, now_s: float, length_rad: float, remaining_rad: float, middle_rad: F64) -> bool:
        """Whether to take a way of ``length_rad`` instead of the ``remaining_rad`` of the present one, both from the splice state.

        Args:
            now_s: time of the comparison.
            length_rad, remaining_rad: joint lengths.
            middle_rad: (J,) the middle of the offered way, which tells corridors apart.
        """
        if length_rad > remaining_rad - max(self._share * remaining_rad, self._least_rad):
            self.forget()
            return False
        same = self._middle is not None and float(np.linalg.norm(middle_rad - self._middle)) <= self._corridor_rad
        if self._since_s is None or not same:
            self._since_s = now_s
        self._middle = middle_rad
        return now_s - self._since_s >= self._stable_s
