"""``tolman watch``: events and changes of state, a line each, as they come."""

from __future__ import annotations

import argparse
from datetime import UTC, datetime
from typing import Any

from clients.cli.options import add_bus_arguments, open_bus, print_json
from common.wire.messages import PlannerEvent, PlannerStatus, RobotState

__all__ = ["Changes", "add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Past events too, or JSON lines."""
    parser.add_argument("--history", action="store_true", help="begin with the events that the planner still has")
    parser.add_argument("--json", action="store_true", help="events as JSON lines, nothing else")
    add_bus_arguments(parser)


class Changes:
    """Turns streams of state into lines, one for each change of what a person would call the state."""

    def __init__(self) -> None:
        self._last: dict[str, tuple[Any, ...]] = {}

    def line(self, name: str, what: tuple[Any, ...]) -> str | None:
        """A line when it differs from the last one of that name."""
        if self._last.get(name) == what:
            return None
        self._last[name] = what
        return f"{name:<8} " + " ".join(str(part) for part in what if part not in (None, ""))


def event_line(event: PlannerEvent) -> str:
    """An event in words."""
    facts = " ".join(f"{name}={value}" for name, value in event.facts.items())
    return f"event    #{event.number} {event.kind} {event.goal_id or ''} {facts}".rstrip()


def _print(stamp_ns: int, line: str | None) -> None:
    if line is not None:
        at = datetime.fromtimestamp(stamp_ns / 1e9, UTC).astimezone()
        print(f"{at:%H:%M:%S}.{at.microsecond // 1000:03d} {line}", flush=True)


def run(args: argparse.Namespace) -> int:
    """Until Ctrl-C."""
    with open_bus(args) as bus:
        events = bus.queue("planner/event", PlannerEvent)
        status = bus.latest("planner/status", PlannerStatus)
        robot = bus.latest("robot/state", RobotState)
        past = bus.get_state("planner/event", PlannerEvent) if args.history else []
        changes = Changes()
        while True:
            for event in past + [received.message for received in events.take_all()]:
                print_json(event) if args.json else _print(event.stamp_ns, event_line(event))
            past = []
            if not args.json:
                for planner in (received.message for received in status.take_all()):
                    _print(planner.stamp_ns, changes.line("planner", (planner.state, planner.goal_id, planner.rule, planner.reason)))
                for arm in (received.message for received in robot.take_all()):
                    _print(arm.stamp_ns, changes.line("robot", (arm.mode, arm.trajectory_id, arm.reason)))
            bus.wake.wait(0.5)
            bus.wake.clear()
