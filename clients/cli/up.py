"""``tolman up``: start the whole stack, in the foreground or detached."""

from __future__ import annotations

import argparse
import os
import sys

from clients.cli.options import add_bus_arguments, add_cell_arguments
from clients.stack import OwnStack, launch_arguments
from common.bus.session import BusAddress
from deploy.processes import StackOptions
from deploy.rundir import RunDirectory

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What the supervisor takes, and ``--detach``."""
    add_cell_arguments(parser)
    add_bus_arguments(parser)
    parser.add_argument("--log-level", default="INFO", choices=["DEBUG", "INFO", "WARNING", "ERROR"])
    parser.add_argument("--detach", action="store_true", help="return as soon as the stack is ready; tolman down stops it")


def run(args: argparse.Namespace) -> int:
    """Become the supervisor, or start one and wait until it is ready."""
    options = StackOptions(BusAddress(args.connect, args.namespace), args.config, tuple(args.set), args.log_level)
    if not args.detach:
        os.execv(sys.executable, [sys.executable, "-m", "deploy.launch", *launch_arguments(options)])
    if RunDirectory(options.address).running_pid() is not None:
        print(f"already up at {args.connect}, namespace {args.namespace}")
        return 0
    stack = OwnStack(options, is_tied=False)
    try:
        with stack.connect() as bus:
            stack.wait_ready(bus)
    except BaseException:
        stack.stop()
        raise
    print(f"up at {args.connect}, namespace {args.namespace}; log: {stack.log_file}")
    return 0
