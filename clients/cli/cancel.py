"""``tolman cancel``: give up the goal."""

from __future__ import annotations

import argparse

from clients.cli.options import add_bus_arguments, open_bus
from common.wire.messages import Ack, CancelGoal

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which goal."""
    parser.add_argument("goal_id", nargs="?", default=None, help="default: whichever is set")
    add_bus_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Send the command and wait for its acknowledgement."""
    with open_bus(args) as bus:
        bus.request("planner/cancel", CancelGoal(goal_id=args.goal_id), Ack)
    print("cancelled")
    return 0
