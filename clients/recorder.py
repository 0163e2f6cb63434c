"""Joint states from the bus, put together to one motion."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from common.errors import RequestError
from common.robot.taught import TaughtMotion
from common.wire.messages import RobotState

__all__ = ["Recorder"]

STILL_RAD = 1e-5  # between two samples; at 125 Hz that is 1.25 mrad/s, far below "standing" of the protocol


class Recorder:
    """Takes ``robot/state`` as it comes; knows when a guided motion has begun and ended.

    Args:
        guide_id: of the guided motion to record, from its first instant to its last; empty: everything until :meth:`motion` is asked.
    """

    def __init__(self, guide_id: str = "") -> None:
        self._guide_id = guide_id
        self._epoch: int | None = None
        self._stamps_ns: list[int] = []
        self._q_rad: list[np.ndarray] = []
        self.is_over = False
        self.reason = ""

    def __len__(self) -> int:
        return len(self._stamps_ns)

    def hear(self, states: Iterable[RobotState]) -> None:
        """Take states in the order of their arrival; one that is not newer than the last is left out.

        Raises:
            RequestError: the robot was started anew: what comes now is not the same motion.
        """
        for state in states:
            if self._epoch is not None and state.epoch != self._epoch:
                raise RequestError("robot/state: the robot was started anew while it was recorded", code="robot_restarted")
            self._epoch = state.epoch
            if self.is_over or (self._guide_id and state.trajectory_id != self._guide_id):
                continue
            if not self._stamps_ns or state.stamp_ns > self._stamps_ns[-1]:
                self._stamps_ns.append(state.stamp_ns)
                self._q_rad.append(state.q_rad)
            if self._guide_id and state.mode not in ("tracking", "stopping"):
                self.is_over, self.reason = True, state.reason

    def motion(self, label: str) -> TaughtMotion:
        """What was recorded, time from 0, without the rests before and after.

        Raises:
            RequestError: the arm did not move.
        """
        q = np.array(self._q_rad) if self._q_rad else np.empty((0, 1))
        moved = np.flatnonzero(np.abs(np.diff(q, axis=0)).max(axis=1, initial=0.0) > STILL_RAD)
        if len(moved) == 0:
            raise RequestError(f"robot/state: the arm did not move in {len(q)} samples", code="no_motion")
        first, last = int(moved[0]), int(moved[-1]) + 2
        t_s = (np.array(self._stamps_ns[first:last]) - self._stamps_ns[first]) / 1e9
        return TaughtMotion(t_s, q[first:last], label)
