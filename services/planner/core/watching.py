"""Whether the motion under way is still good; only what has changed is looked at."""

from __future__ import annotations

from typing import Literal

import numpy as np

from services.planner.core.check import TOUCH_M, Checker, HandReach
from services.planner.core.underway import Sent
from services.planner.core.vision import Vision

__all__ = ["Watch"]

LOOKS_OUT = 60  # poses of a way out that are looked at again; our choice


class Watch:
    """Knows at which times of what is under way something is in the way, or a hand could be before the arm stands."""

    def __init__(self, checker: Checker, rules: Literal["checked", "paper"]) -> None:
        self._checker = checker
        self._rules = rules
        self._blocked_at_s: float | None = None
        self._hand_at_s: float | None = None
        self._look_at_all = False

    def begin(self) -> None:
        """Another motion is under way, and it has just been checked."""
        self._blocked_at_s = self._hand_at_s = None
        self._look_at_all = False

    def take_back(self) -> None:
        """An earlier motion is under way again (the robot refused its successor): it was not watched meanwhile."""
        self._blocked_at_s = self._hand_at_s = None
        self._look_at_all = True

    def rearm(self, checker: Checker) -> None:
        """The arm is another one (it holds something, or no more): look at all of what is under way."""
        self._checker = checker
        self.take_back()

    @property
    def met_at_s(self) -> float | None:
        """The first such time; None: free."""
        return min((t for t in (self._blocked_at_s, self._hand_at_s) if t is not None), default=None)

    def look(self, sent: Sent, from_s: float, vision: Vision, hand: HandReach, *, changed: bool) -> None:
        """Look at what is under way from one of its times on, where cells ``changed`` or it was not watched; ``hand`` as of now."""
        if sent.kind == "stop" or not (changed or self._look_at_all):
            return
        all_of_it = self._look_at_all or self._blocked_at_s is not None  # a way that was blocked may have become free again
        self._look_at_all = False
        if self._rules == "paper":
            path = sent.motion.path.neurons if sent.motion is not None else np.empty(0, dtype=np.int32)
            blocked = np.any(vision.counts.node[path] > 0)  # by the paper's rules every point is a neuron
            self._blocked_at_s = self._first_blocked(sent, from_s, vision) if blocked else None
            return
        if sent.motion is not None and sent.motion.path.leaving is not None and self._leads_out(sent, from_s, vision, hand):
            self._blocked_at_s = self._hand_at_s = None
            return
        if all_of_it:
            self._blocked_at_s = self._first_blocked(sent, from_s, vision)
        else:
            self._blocked_at_s = self._checker.curve_meets(vision.appeared, sent.curve, from_s=from_s)
        self._hand_at_s = self._checker.hand_meets(vision.world.recent, sent.curve, hand, from_s=from_s)

    def _leads_out(self, sent: Sent, from_s: float, vision: Vision, hand: HandReach) -> bool:
        """Whether a motion that leaves cells is as good as when it was sent, though the hand may have followed: to stop would be worse."""
        world, curve = vision.world, sent.curve
        if self._checker.hand_meets(world.recent, curve, hand, from_s=from_s, safety_m=TOUCH_M) is not None:
            return False
        leaving = world.leaving(self._checker, curve.sample(from_s)[0])
        if leaving is None:
            return self._first_blocked(sent, from_s, vision) is None
        remaining = curve.sample(np.linspace(from_s, curve.duration_s, LOOKS_OUT))[0]
        return self._checker.curve_meets(leaving.rest.cells, curve, from_s=from_s) is None and leaving.leads_out(self._checker, remaining)

    def _first_blocked(self, sent: Sent, from_s: float, vision: Vision) -> float | None:
        return self._checker.curve_meets(vision.world.cells, sent.curve, from_s=from_s)
