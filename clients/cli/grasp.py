"""``tolman grasp``: tell the arm that its gripper holds a box from now on, or nothing; everything that plans and sees reckons with it."""

from __future__ import annotations

import argparse
import time

from clients.cli.options import add_bus_arguments, open_bus
from clients.waiting import wait_until
from common.bus.session import RemoteError
from common.wire.messages import Ack, Grasp, HeldBox, PlannerEvent, PlannerStatus

__all__ = ["add_arguments", "run"]

READY_WITHIN_S = 60.0  # our choice; a table for a box takes some seconds, on a busy machine some more


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The box, or that there is none."""
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--box", type=float, nargs=3, metavar="M", help="full extents of the box along the axes of the tool")
    what.add_argument("--release", action="store_true", help="the gripper holds nothing")
    parser.add_argument("--at", type=float, nargs=3, default=[0.0, 0.0, 0.0], metavar="M", help="middle of the box in the tool frame")
    add_bus_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """0: the arm holds it, and the planner plans with it."""
    box = None if args.release else HeldBox(size_m=args.box, position_m=args.at)
    began_s = time.monotonic()
    with open_bus(args) as bus:
        statuses, events = bus.latest("planner/status", PlannerStatus), bus.queue("planner/event", PlannerEvent)
        bus.request("robot/grasp", Grasp(op="release" if box is None else "grasp", box=box), Ack)
        told = ""

        def planner_is_ready() -> bool:
            nonlocal told
            for event in events.take_all():
                if "problem" in event.message.facts:
                    raise RemoteError(f"the planner cannot hold it: {event.message.facts['problem']}", code="cannot_hold")
            received = statuses.take()
            if received is None:
                return False
            told = received.message.reason
            return received.message.held == box

        if not wait_until(bus, planner_is_ready, READY_WITHIN_S):
            raise RemoteError(
                f"the planner is not ready for it within {READY_WITHIN_S:g} s: {told or 'no planner/status'}", code="not_ready"
            )
    print(f"{'released' if box is None else 'held'}; the planner is ready after {time.monotonic() - began_s:.1f} s")
    return 0
