"""A robot that only says where it is: publishes ``robot/state`` and ``robot/scene`` at their rates from a thread of its own."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from common.bus.session import Bus
from common.clock import monotonic_ns
from common.wire.messages import Obstacle, RobotState, Scene

PERIOD_S = 0.008


class FakeRobot:
    """Moves as ``motion(seconds) -> (q, dq)`` says and shows ``obstacles`` as they are now."""

    def __init__(self, bus: Bus, motion: Callable[[float], tuple[NDArray[np.float64], NDArray[np.float64]]]) -> None:
        self.obstacles: list[Obstacle] = []
        self._bus, self._motion = bus, motion
        self._states = bus.publisher("robot/state", RobotState)
        self._scenes = bus.publisher("robot/scene", Scene)
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._end.set()
        self._thread.join()

    def _run(self) -> None:
        started_ns, k = monotonic_ns(), 0
        while not self._end.wait(max(0.0, started_ns * 1e-9 + k * PERIOD_S - monotonic_ns() * 1e-9)):
            q, dq = self._motion((monotonic_ns() - started_ns) * 1e-9)
            state = RobotState(
                q_rad=q,
                dq_rad_s=dq,
                q_reference_rad=q,
                mode="tracking",
                reason="",
                trajectory_id="",
                trajectory_time_s=0.0,
                trajectory_accepted_ns=0,
            )
            self._states.publish(state)
            if k % 4 == 0:
                self._scenes.publish(Scene(obstacles=list(self.obstacles)))
            self._bus.answer_gets()
            k += 1
