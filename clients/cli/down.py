"""``tolman down``: stop the stack that a supervisor of this machine runs."""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import sys
import time

from clients.cli.options import add_bus_arguments
from common.bus.session import BusAddress
from deploy.rundir import RunDirectory

__all__ = ["add_arguments", "run"]

STOP_WITHIN_S = 15.0  # the supervisor itself kills after 5 s, see deploy.launch


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which stack."""
    add_bus_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """0: stopped, or nothing ran; 1: it did not stop in time."""
    directory = RunDirectory(BusAddress(args.connect, args.namespace))
    pid = directory.running_pid()
    if pid is None:
        print(f"nothing runs at {args.connect}, namespace {args.namespace}")
        return 0
    with contextlib.suppress(ProcessLookupError):
        os.kill(pid, signal.SIGINT)
    deadline_s = time.monotonic() + STOP_WITHIN_S
    while directory.running_pid() is not None:
        if time.monotonic() > deadline_s:
            print(f"timeout: the supervisor (pid {pid}) did not stop within {STOP_WITHIN_S:g} s", file=sys.stderr)
            return 1
        time.sleep(0.05)
    print("down")
    return 0
