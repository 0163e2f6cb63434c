"""``tolman demo``: the whole loop at work. Starts a stack of its own unless told to use a running one."""

from __future__ import annotations

import argparse
import json
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from benchmarks.provenance import provenance
from clients.cli.options import add_bus_arguments, add_cell_arguments, open_bus
from clients.demo.arm import Arm
from clients.demo.config import DemoConfig
from clients.demo.display import display, summary
from clients.demo.run import DemoRun
from clients.stack import OwnStack, free_endpoint, is_free
from clients.waiting import wait_for_owners
from common import cell
from common.bus.session import DEFAULT_ENDPOINT, Bus, BusAddress, RemoteError
from common.clock import utc_ns
from common.config import load_tables
from common.robot.model import load_robot
from deploy.processes import StackOptions
from deploy.rundir import RunDirectory

__all__ = ["add_arguments", "run"]

NOTHING_KEPT = "planner.learning.keep=false"  # a demo leaves the user's map as it is: equal seeds meet equal maps
ATTACH_WITHIN_S = 60.0  # our choice: a stack that is being started may still compile


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """How long, which script, where the figures go."""
    parser.add_argument("--headless", action="store_true", help="a progress line now and then instead of the live table")
    parser.add_argument("--seconds", type=float, default=0.0, metavar="S", help="0: until Ctrl-C (default)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of goals and obstacles (default %(default)s)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there")
    parser.add_argument("--picture", type=Path, metavar="FILE", help="where the picture of the scene goes (default: the run directory)")
    parser.add_argument("--attach", action="store_true", help="use the stack that runs at --connect")
    parser.add_argument("--log-level", default="INFO", choices=["DEBUG", "INFO", "WARNING", "ERROR"])
    add_cell_arguments(parser)
    add_bus_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """0: it ran and the figures are written; Ctrl-C ends it like the end of its time."""
    started_ns = utc_ns()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    console = Console(highlight=False, soft_wrap=True)
    shared, config = cell.load(args.config, "demo", DemoConfig, args.set)
    with ExitStack() as stack:
        bus = stack.enter_context(_attached(args) if args.attach else _own_stack(args, console))
        arm = Arm(load_robot(shared.robot))
        demo = DemoRun(bus, arm, config, args.seed)
        demo.prepare()
        with display(console, demo, is_live=console.is_terminal and not args.headless) as show, _gentle_interrupt() as should_stop:
            demo.play(args.seconds, should_stop, show)
        report = {**provenance(args.seed, load_tables(args.config, args.set)), **demo.finish()}
        first_motion_ns = demo.collector.first_motion_ns
        report["first_motion_after_s"] = None if first_motion_ns is None else (first_motion_ns - started_ns) / 1e9
        if args.json is not None:
            args.json.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
        picture = args.picture or RunDirectory(bus.address).path / "demo.png"
        if demo.keeper.best is not None:
            from clients.demo.picture import draw  # noqa: PLC0415 (matplotlib takes a second to load)

            draw(demo.keeper.best, arm, shared.static, picture)
            console.print(f"picture: {picture}")
        console.print(summary(report))
    return 0


@contextmanager
def _gentle_interrupt() -> Iterator[Callable[[], bool]]:
    """Within it the first Ctrl-C only sets what ``should_stop`` answers; a second one interrupts as ever."""
    is_interrupted = False

    def on_signal(_number: int, _frame: object) -> None:
        nonlocal is_interrupted
        is_interrupted = True
        signal.signal(signal.SIGINT, signal.default_int_handler)

    before = {number: signal.signal(number, on_signal) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: is_interrupted
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def _attached(args: argparse.Namespace) -> Iterator[Bus]:
    with open_bus(args) as bus:
        missing = wait_for_owners(bus, ATTACH_WITHIN_S)
        if missing:
            raise RemoteError(f"not alive within {ATTACH_WITHIN_S:g} s: {', '.join(missing)}", code="not_ready")
        yield bus


@contextmanager
def _own_stack(args: argparse.Namespace, console: Console) -> Iterator[Bus]:
    """A session with a stack that lives as long as the demo; on another port if the usual one is taken."""
    address = BusAddress(args.connect, args.namespace)
    if args.connect == DEFAULT_ENDPOINT and not is_free(args.connect):
        address = replace(address, endpoint=free_endpoint())
    started_s = time.monotonic()
    own = OwnStack(StackOptions(address, args.config, (NOTHING_KEPT, *args.set), args.log_level))
    try:
        with own.connect() as bus:
            with console.status("starting the stack; the first time of all it builds the map, which takes minutes"):
                own.wait_ready(bus)
            console.print(f"the stack is ready after {time.monotonic() - started_s:.1f} s; log: {own.log_file}")
            yield bus
    finally:
        own.stop()
