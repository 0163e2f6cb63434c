"""The supervisor: router first, then the process table in order of readiness; restarts what ends; stops everything in order.

``python -m deploy.launch`` runs one stack in the foreground; ``tolman up`` is its short name. INT or TERM stops it, a second one at once.
"""

from __future__ import annotations

import argparse
import signal
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path

from common.bus.service import add_bus_arguments
from common.bus.session import Bus, BusAddress, Router
from common.errors import TolmanError
from deploy.child import Child
from deploy.merged_log import MergedLog
from deploy.processes import PROCESSES, Process, StackOptions, command_line
from deploy.row import Action, Phase, Row
from deploy.rundir import RunDirectory

__all__ = ["StackError", "Supervisor", "main"]

TURN_S = 0.05  # our choice: how soon an exit is noticed; lost tokens wake at once
GRACE_S = 5.0  # our choice: from INT to KILL


class StackError(TolmanError):
    """A stack cannot run because one of its processes cannot start."""

    code = "cannot_start"


class Supervisor:
    """Runs one stack. The router must be reachable at ``options.address`` already."""

    def __init__(self, options: StackOptions, bus: Bus, log: MergedLog, processes: Sequence[Process] = PROCESSES) -> None:
        self._options = options
        self._bus = bus
        self._log = log
        self._rows = {process.name: Row(process) for process in processes}
        self._children: dict[str, Child] = {}
        self._alive: dict[str, bool] = {}
        self._is_announced = False
        bus.watch_alive(self._alive.__setitem__)

    def run(self, should_stop: Callable[[], bool]) -> None:
        """Supervise until told to stop.

        Raises:
            StackError: a process cannot start at all; its last words are in the message.
        """
        while not should_stop():
            self._bus.wake.clear()
            for row in self._rows.values():
                self._turn(row, time.monotonic())
                if row.phase is Phase.FAILED:
                    raise self._failure(row.process.name)
            self._announce()
            self._bus.wake.wait(TURN_S)

    def stop(self, is_urgent: Callable[[], bool]) -> None:
        """INT to all, wait, KILL what is left; ``is_urgent`` (a second Ctrl-C) ends the waiting."""
        for child in reversed(self._children.values()):
            child.interrupt()
        deadline_s = time.monotonic() + GRACE_S
        for name, child in self._children.items():
            while not child.wait(TURN_S):
                if is_urgent() or time.monotonic() > deadline_s:
                    self._say(f"{name} did not stop: killed")
                    child.kill()
                    child.wait(GRACE_S)
                    break
        self._say("stopped")

    def _turn(self, row: Row, now_s: float) -> None:
        name = row.process.name
        child = self._children.get(name)
        exit_code = None if child is None else child.exit_code()
        needs_met = all(self._rows[need].satisfies for need in row.process.needs)
        action = row.step(now_s, exit_code=exit_code, is_alive=self._alive.get(name, False), needs_met=needs_met)
        if row.note:
            self._say(f"{name}: {row.note}")
        if action is Action.START:
            self._alive[name] = False  # a token of the former process must not count for the new one
            self._children[name] = Child(name, command_line(row.process, self._options), self._log.write)
        elif action is Action.KILL and child is not None:
            child.kill()

    def _failure(self, name: str) -> StackError:
        self._children[name].wait(1.0)  # until its last lines are here
        return StackError(f"{name} cannot start: {self._log.last_line(name)}", facts={"process": name})

    def _announce(self) -> None:
        is_complete = all(row.satisfies for row in self._rows.values())
        if is_complete and not self._is_announced:
            self._say(f"the stack is ready at {self._options.address.endpoint}, namespace {self._options.address.namespace}")
        self._is_announced = is_complete

    def _say(self, text: str) -> None:
        self._log.write("supervisor", text)


class _Signals:
    """Counts INT and TERM."""

    def __init__(self) -> None:
        self.count = 0
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self._on_signal)

    def _on_signal(self, _number: int, _frame: object) -> None:
        self.count += 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m deploy.launch", description="run the whole stack in the foreground")
    parser.add_argument("--config", type=Path, default=None, metavar="FILE", help="cell config (TOML); default: the UR3 cell")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="override one config value in all processes")
    parser.add_argument("--log-level", default="INFO", choices=["DEBUG", "INFO", "WARNING", "ERROR"])
    parser.add_argument("--no-router", action="store_true", help="a router runs at the endpoint already")
    parser.add_argument("--quiet", action="store_true", help="log into the file only")
    add_bus_arguments(parser)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one stack until INT or TERM."""
    args = _parser().parse_args(arguments)
    signals = _Signals()
    address = BusAddress(args.connect, args.namespace)
    options = StackOptions(address, args.config, tuple(args.set), args.log_level)
    directory = RunDirectory(address)
    try:
        with ExitStack() as stack:
            directory.claim()
            stack.callback(directory.release)
            directory.rotate_logs()
            log = MergedLog(directory.log_file, terminal=None if args.quiet else sys.stderr)
            stack.callback(log.close)
            if not args.no_router:
                stack.enter_context(Router(address.endpoint))
            bus = stack.enter_context(Bus(address))
            supervisor = Supervisor(options, bus, log)
            stack.callback(supervisor.stop, lambda: signals.count > 1)
            supervisor.run(lambda: signals.count > 0)
    except TolmanError as error:
        print(f"{error.code}: {error.message}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
