"""One demo on a running stack: script and driver on one side, figures and picture on the other, the bus in between."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from clients.demo.arm import Arm
from clients.demo.collect import Collector
from clients.demo.config import DemoConfig
from clients.demo.driver import Driver, Orders, Seen
from clients.demo.moment import MomentKeeper
from clients.demo.script import acts, goals
from clients.monitor import Monitor
from clients.waiting import GOAL_ENDS, wait_until
from common.bus.session import Bus, RemoteError
from common.wire.messages import Ack, Clearance, Empty, GoalAccepted, Message, PlannerEvent, PlannerStatus, RobotState, SetObstacle

__all__ = ["DemoRun"]

TURN_S = 0.02  # our choice: messages wake it anyway; this bounds how late an act is
FIRST_STATE_WITHIN_S = 10.0


class DemoRun:
    """Plays the script of a seed on the stack behind ``bus``; one use."""

    def __init__(self, bus: Bus, arm: Arm, config: DemoConfig, seed: int) -> None:
        self.collector = Collector()
        self.keeper = MomentKeeper(arm)
        self.monitor = Monitor(bus)
        self.driver = Driver(goals(seed, config), acts(seed, config), patience_s=config.goal_patience_s)
        self.watchers: list[Callable[[Message], None]] = []  # called with every message of every state channel
        self.elapsed_s = 0.0
        self._bus = bus
        self._arm = arm
        self._config = config
        self._events = bus.queue("planner/event", PlannerEvent)
        self._start_s = 0.0

    def prepare(self) -> None:
        """A clean scene, counters at zero, and every channel heard once.

        Raises:
            RemoteError: the robot does not answer, or planner or perception stay silent.
        """
        self._bus.request("robot/obstacle", SetObstacle(op="clear"), Ack)
        self._bus.request("robot/reset", Empty(), Ack)

        def all_heard() -> bool:
            self.monitor.update()
            return all(self.monitor.newest(key) is not None for key in ("robot/state", "planner/status", "perception/voxels"))

        if not wait_until(self._bus, all_heard, FIRST_STATE_WITHIN_S):
            raise RemoteError(f"not every channel was heard within {FIRST_STATE_WITHIN_S:g} s", code="silent")
        self._start_s = time.monotonic()

    def play(self, seconds: float, should_stop: Callable[[], bool], show: Callable[[], None]) -> None:
        """Until ``seconds`` are over (0: without end) or ``should_stop``; ``show`` is called at each turn."""
        while not should_stop() and (seconds <= 0.0 or self.elapsed_s < seconds):
            self._bus.wake.wait(TURN_S)
            self._bus.wake.clear()
            self._turn()
            show()

    def _turn(self) -> None:
        self.elapsed_s = time.monotonic() - self._start_s
        for received in self.monitor.update():
            self.collector.observe(received.message)
            self.keeper.observe(received.message)
            for watch in self.watchers:
                watch(received.message)
        ended = {}
        for event in (received.message for received in self._events.take_all()):
            self.collector.observe_event(event)
            if event.kind in GOAL_ENDS and event.goal_id is not None:
                ended[event.goal_id] = event.kind
        status: PlannerStatus = self.monitor.newest("planner/status")
        self._carry_out(self.driver.step(self.elapsed_s, Seen(ended, status.goal_id, self._is_fair)))

    def _is_fair(self, obstacle: SetObstacle) -> bool:
        state: RobotState = self.monitor.newest("robot/state")
        boxes = self._config.boxes
        assert obstacle.size_m is not None
        assert obstacle.position_m is not None
        distance_m = self._arm.keeps_clear_of(state.q_rad, state.dq_rad_s, obstacle.size_m, obstacle.position_m, boxes.horizon_s)
        return distance_m >= boxes.clearance_m

    def _carry_out(self, orders: Orders) -> None:
        for obstacle in orders.obstacles:
            self._bus.request("robot/obstacle", obstacle, Ack)
        if orders.goal is None:
            return
        try:
            reply = self._bus.request("planner/goal", orders.goal, GoalAccepted)
        except RemoteError as error:
            if error.code != "no_answer":  # a planner that is being restarted does not answer; the goal stays due
                self.driver.refused()
            return
        self.driver.accepted(reply.goal_id, self.elapsed_s)

    def finish(self) -> dict[str, Any]:
        """Clear the scene and sum up; the figures of the issue's list."""
        clearance = self._bus.request("robot/clearance", Empty(), Clearance)
        self.monitor.ask_health()
        rates_hz = {key: watch.mean_rate_hz() for key, watch in sorted(self.monitor.channels.items())}
        figures = self.collector.figures(self._arm, self.driver.tally, clearance, self.monitor.health, rates_hz)
        self._bus.request("robot/obstacle", SetObstacle(op="clear"), Ack)
        return {"seconds": self.elapsed_s, **figures}
