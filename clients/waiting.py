"""Waiting for what a stack does: owners to become ready, a goal to end."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

from common.bus.channels import Queue
from common.bus.session import Bus
from common.wire.keys import OWNERS
from common.wire.messages import PlannerEvent

__all__ = ["GOAL_ENDS", "ending", "wait_for_goal", "wait_for_owners", "wait_until"]

GOAL_ENDS = ("goal_reached", "goal_cancelled", "goal_failed", "goal_replaced")
TURN_S = 0.1  # a message wakes at once; this only bounds how late a timeout or a dead process is noticed


def wait_until(bus: Bus, condition: Callable[[], bool], timeout_s: float) -> bool:
    """Whether the condition came true within the time; it is asked anew whenever something arrives on the bus."""
    deadline_s = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > deadline_s:
            return False
        bus.wake.wait(TURN_S)
        bus.wake.clear()
    return True


def wait_for_owners(bus: Bus, timeout_s: float, on_turn: Callable[[], None] = lambda: None) -> list[str]:
    """Wait until every owner shows its liveliness token; the owners that do not when the time is over. ``on_turn`` may raise to end it."""
    alive: dict[str, bool] = {}
    bus.watch_alive(alive.__setitem__)

    def missing() -> list[str]:
        return [owner for owner in OWNERS if not alive.get(owner, False)]

    def is_ready() -> bool:
        on_turn()
        return not missing()

    return [] if wait_until(bus, is_ready, timeout_s) else missing()


def wait_for_goal(bus: Bus, events: Queue[PlannerEvent], goal_id: str, timeout_s: float) -> PlannerEvent | None:
    """The event that ends the goal, or None when there is none within the time.

    Args:
        events: queue of ``planner/event``, declared before the goal was sent.
    """
    closing: list[PlannerEvent] = []

    def is_over() -> bool:
        closing.extend(ending(goal_id, (received.message for received in events.take_all())))
        return bool(closing)

    return closing[0] if wait_until(bus, is_over, timeout_s) else None


def ending(goal_id: str, events: Iterable[PlannerEvent]) -> list[PlannerEvent]:
    """Those events that end this goal."""
    return [event for event in events if event.goal_id == goal_id and event.kind in GOAL_ENDS]
