"""``tolman status``: a live table of rates, ages, latencies, modes and states."""

from __future__ import annotations

import argparse
import time
from typing import Any

from rich.console import Console
from rich.live import Live

from clients.cli.options import add_bus_arguments, open_bus, plain, print_json
from clients.monitor import Monitor
from clients.view import stack_view
from clients.waiting import wait_until
from common.bus.session import Bus

__all__ = ["add_arguments", "run"]

REFRESH_S = 0.5  # our choice
ONCE_WATCHES_S = 1.5  # our choice: a rate needs a while


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Live, once, or as JSON."""
    parser.add_argument("--once", action="store_true", help="print the table once and leave")
    parser.add_argument("--json", action="store_true", help="print everything once as JSON and leave")
    add_bus_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Until Ctrl-C; with ``--once`` or ``--json``: 0 if every owner is alive and well, else 1."""
    with open_bus(args) as bus:
        monitor = Monitor(bus)
        _watch(bus, monitor, ONCE_WATCHES_S if args.once or args.json else REFRESH_S)
        if args.json:
            print_json(snapshot(monitor))
        elif args.once:
            Console().print(stack_view(monitor))
        else:
            _live(bus, monitor)
        return 0 if all(owner in monitor.health and monitor.health[owner].ok for owner in monitor.alive) else 1


def _watch(bus: Bus, monitor: Monitor, seconds: float) -> None:
    end_s = time.monotonic() + seconds

    def is_over() -> bool:
        monitor.update()
        return time.monotonic() >= end_s

    wait_until(bus, is_over, seconds + 1.0)
    monitor.ask_health()


def _live(bus: Bus, monitor: Monitor) -> None:
    with Live(stack_view(monitor), auto_refresh=False, screen=True) as live:
        while True:
            _watch(bus, monitor, REFRESH_S)
            live.update(stack_view(monitor), refresh=True)


def snapshot(monitor: Monitor) -> dict[str, Any]:
    """The table as data; of the states only those without arrays of images and cells."""
    return {
        "channels": {row.key: {"rate_hz": row.rate_hz, "age_ms": row.age_ms, "latency_ms": row.latency_ms} for row in monitor.figures()},
        "alive": monitor.alive,
        "health": plain(monitor.health),
        "robot": plain(monitor.newest("robot/state")),
        "planner": plain(monitor.newest("planner/status")),
    }
