"""The one loop that every service runs in: wait for an event or a deadline, step, answer, count.

A service is a class with ``warm_up() step(now_ns) close()``; see :class:`Service`. ``main`` is the whole of every ``__main__``.
"""

from __future__ import annotations

import argparse
import logging
import os
import signal
import socket
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from common import log as logs
from common.bus.session import DEFAULT_ENDPOINT, DEFAULT_NAMESPACE, Bus, BusAddress
from common.clock import monotonic_ns, utc_ns
from common.errors import TolmanError
from common.version import VERSION
from common.wire import keys
from common.wire.messages import Empty, ServiceHealth, ServiceInfo

__all__ = ["Meter", "Service", "Vitals", "add_bus_arguments", "main", "run"]

STATISTICS_WINDOW = 512


class Service(Protocol):
    """What the loop drives."""

    def warm_up(self) -> None:
        """Load, compile, allocate: everything that must be over before the first message counts."""

    def step(self, now_ns: int) -> int | None:
        """Take what came in, publish what follows; return the monotonic deadline of the next step without an event (or None)."""

    def close(self) -> None:
        """Release what is not the bus."""


class Meter:
    """Rate and latency of one thing, over a sliding window."""

    def __init__(self) -> None:
        self._at_ns: deque[int] = deque(maxlen=STATISTICS_WINDOW)
        self._ms: deque[float] = deque(maxlen=STATISTICS_WINDOW)

    def tick(self, now_ns: int, ms: float | None = None) -> None:
        """One occurrence now, which took ``ms`` milliseconds."""
        self._at_ns.append(now_ns)
        if ms is not None:
            self._ms.append(ms)

    def rate_hz(self, now_ns: int, window_s: float = 2.0) -> float:
        """Occurrences a second over the last ``window_s`` seconds (or over the full window if that is shorter)."""
        recent = [t for t in self._at_ns if now_ns - t <= window_s * 1e9]
        if len(recent) < 2:
            return 0.0
        return float((len(recent) - 1) / max((recent[-1] - recent[0]) / 1e9, 1e-9))

    def percentiles_ms(self) -> dict[str, float] | None:
        """``{p50, p95, p99}`` or None before the first measurement."""
        if not self._ms:
            return None
        p50, p95, p99 = np.percentile(np.asarray(self._ms), [50, 95, 99])
        return {"p50": float(p50), "p95": float(p95), "p99": float(p99)}


class Vitals:
    """Health of a service, gathered while it runs and answered on ``<owner>/health``."""

    def __init__(self) -> None:
        self.reasons: list[str] = []
        self.counters: dict[str, int] = {}
        self.meters: dict[str, Meter] = {}

    def meter(self, name: str) -> Meter:
        """The meter of that name, made at first use."""
        return self.meters.setdefault(name, Meter())

    def count(self, name: str, n: int = 1) -> None:
        """Add to a counter."""
        self.counters[name] = self.counters.get(name, 0) + n

    def message(self, bus_counters: dict[str, int], now_ns: int) -> ServiceHealth:
        """The health message of this moment."""
        latency = {name: p for name, meter in self.meters.items() if (p := meter.percentiles_ms()) is not None}
        return ServiceHealth(
            ok=not self.reasons,
            reasons=list(self.reasons),
            counters={**bus_counters, **self.counters},
            rates_hz={name: meter.rate_hz(now_ns) for name, meter in self.meters.items()},
            latency_ms=latency,
        )


def run(
    owner: str,
    bus: Bus,
    service: Service,
    vitals: Vitals,
    *,
    config: dict[str, Any],
    fingerprints: Callable[[], dict[str, str]],
    should_stop: Callable[[], bool],
) -> None:
    """Warm up, tell that we are alive, then loop until ``should_stop``. Errors of one step are counted, logged and survived."""
    log = logging.getLogger(owner)
    limit = logs.RateLimit()
    started_ns = utc_ns()
    service.warm_up()
    infos = bus.commands(keys.info(owner), Empty)
    healths = bus.commands(keys.health(owner), Empty)
    bus.declare_alive(owner)
    log.info("ready")
    while not should_stop():
        bus.wake.clear()
        now_ns = monotonic_ns()
        try:
            deadline_ns = service.step(now_ns)
        except Exception as error:  # nothing that a client sends may end a service
            vitals.count("step_errors")
            if limit.allow(type(error).__name__, now_ns):
                log.exception("step failed")
            deadline_ns = now_ns + 10_000_000
        bus.answer_gets()
        for command in infos.take_all():
            command.reply(
                ServiceInfo(
                    owner=owner,
                    version=VERSION,
                    started_ns=started_ns,
                    host=socket.gethostname(),
                    pid=os.getpid(),
                    config=config,
                    fingerprints=fingerprints(),
                )
            )
        for command in healths.take_all():
            command.reply(vitals.message(bus.counters, monotonic_ns()))
        wait_s = 0.1 if deadline_ns is None else (deadline_ns - monotonic_ns()) / 1e9
        if wait_s > 0:
            bus.wake.wait(min(wait_s, 0.1))  # a tenth: signals must be noticed


def add_bus_arguments(parser: argparse.ArgumentParser) -> None:
    """``--connect`` and ``--namespace``, the same for every process and command."""
    parser.add_argument("--connect", default=DEFAULT_ENDPOINT, metavar="ENDPOINT", help="Zenoh router (default %(default)s)")
    parser.add_argument("--namespace", default=DEFAULT_NAMESPACE, help="prefix of this robot cell's keys (default %(default)s)")


def main(owner: str, description: str, start: Callable[[Bus, Path, list[str], Vitals], tuple[Service, dict[str, Any]]]) -> int:
    """Parse the command line, open the bus, run the service until INT or TERM.

    Args:
        owner: first chunk of the keys that this process writes.
        description: for ``--help``.
        start: makes the service from bus, config path, ``--set`` overrides and vitals; returns it with its config as plain data.
    """
    parser = argparse.ArgumentParser(prog=f"python -m services.{owner}", description=description)
    parser.add_argument("--config", type=Path, default=None, metavar="FILE", help="cell config (TOML); default: the UR3 cell")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", help="override one config value, for example planner.rules=paper"
    )
    parser.add_argument("--log-level", default="INFO", choices=["DEBUG", "INFO", "WARNING", "ERROR"])
    add_bus_arguments(parser)
    args = parser.parse_args()
    log = logs.setup(owner, level=args.log_level)
    stopping = False

    def stop(_signal: int, _frame: object) -> None:
        nonlocal stopping
        stopping = True

    signal.signal(signal.SIGINT, stop)
    signal.signal(signal.SIGTERM, stop)
    try:
        with Bus(BusAddress(args.connect, args.namespace)) as bus:
            vitals = Vitals()
            service, config = start(bus, args.config, args.set, vitals)
            try:
                fingerprints = getattr(service, "fingerprints", dict)
                run(owner, bus, service, vitals, config=config, fingerprints=fingerprints, should_stop=lambda: stopping)
            finally:
                service.close()
    except TolmanError as error:
        log.error("%s: %s", error.code, error.message)
        return 2
    return 0
