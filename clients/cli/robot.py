"""``tolman stop | resume | reset``: the commands of the robot that take no arguments."""

from __future__ import annotations

import argparse

from clients.cli.options import add_bus_arguments, open_bus
from common.wire.messages import Ack, Empty

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Only where the robot is."""
    add_bus_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Send the command and wait for its acknowledgement."""
    with open_bus(args) as bus:
        bus.request(f"robot/{args.command}", Empty(), Ack)
    print(f"{args.command}: done")
    return 0
