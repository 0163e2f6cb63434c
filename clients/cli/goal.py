"""``tolman goal``: send the arm somewhere, and wait for it if asked to."""

from __future__ import annotations

import argparse
import sys

from clients.cli.options import add_bus_arguments, add_goal_arguments, goal_of, open_bus, print_json
from clients.waiting import wait_for_goal
from common.wire.messages import GoalAccepted, PlannerEvent

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The goal, and whether to wait for it."""
    add_goal_arguments(parser)
    parser.add_argument("--wait", action="store_true", help="until it is reached, given up or has failed")
    parser.add_argument("--timeout", type=float, default=60.0, metavar="S", help="of --wait (default %(default)s)")
    parser.add_argument("--json", action="store_true", help="print the goal id, or with --wait the closing event, as JSON")
    add_bus_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """0: accepted, or with ``--wait`` reached; 1: ended otherwise or not in time."""
    goal = goal_of(args)
    with open_bus(args) as bus:
        events = bus.queue("planner/event", PlannerEvent)
        accepted = bus.request("planner/goal", goal, GoalAccepted)
        if not args.wait:
            print_json(accepted) if args.json else print(f"accepted as {accepted.goal_id}")
            return 0
        closing = wait_for_goal(bus, events, accepted.goal_id, args.timeout)
    if closing is None:
        print(f"timeout: {accepted.goal_id} was not reached within {args.timeout:g} s", file=sys.stderr)
        return 1
    print_json(closing) if args.json else print(f"{accepted.goal_id}: {closing.kind}")
    return 0 if closing.kind == "goal_reached" else 1
