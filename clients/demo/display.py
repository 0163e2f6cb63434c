"""What a person sees of a demo: a live table, or a line now and then, and the figures at the end."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console, Group
from rich.live import Live
from rich.text import Text

from clients.demo.run import DemoRun
from clients.view import stack_view

__all__ = ["display", "progress", "summary"]

LINE_EVERY_S = 5.0  # our choice
VIEW_EVERY_S = 0.5
HEALTH_EVERY_S = 2.0


@contextmanager
def display(console: Console, demo: DemoRun, *, is_live: bool) -> Iterator[Callable[[], None]]:
    """Yields what is to be called at each turn."""
    if not is_live:
        yield _every(LINE_EVERY_S, lambda: console.print(progress(demo)))
        return
    with Live(console=console, auto_refresh=False, screen=True) as live:
        ask = _every(HEALTH_EVERY_S, demo.monitor.ask_health)
        draw = _every(VIEW_EVERY_S, lambda: live.update(Group(Text(progress(demo)), Text(), stack_view(demo.monitor)), refresh=True))

        def show() -> None:
            ask()
            draw()

        yield show


def _every(period_s: float, action: Callable[[], None]) -> Callable[[], None]:
    next_s = time.monotonic() + period_s

    def maybe() -> None:
        nonlocal next_s
        if time.monotonic() >= next_s:
            next_s = time.monotonic() + period_s
            action()

    return maybe


def progress(demo: DemoRun) -> str:
    """How it stands, in a line."""
    tally, collector = demo.driver.tally, demo.collector
    status = demo.monitor.newest("planner/status")
    reaction = collector.reactions()
    words = [
        f"{demo.elapsed_s:6.1f} s",
        f"{tally.cycles} cycles",
        f"{tally.reached} goals",
        "replans " + (" ".join(f"{rule} {n}" for rule, n in collector.replans.items()) or "0"),
        f"stops {collector.events['stopped']}",
        f"planner {status.state}" + (f" ({status.reason})" if status.reason else ""),
    ]
    if reaction is not None:
        words.append(f"reaction {reaction['p50']:.0f} ms (p95 {reaction['p95']:.0f})")
    return "  ".join(words)


def summary(report: dict[str, Any]) -> str:
    """The figures that people ask for first."""
    reaction = report["reaction_ms"]
    return "\n".join(
        [
            f"{report['seconds']:.0f} s, seed {report['seed']}: {report['cycles']} cycles, {report['goals_reached']} goals reached",
            f"contacts: {report['contacts_caused']} caused, {report['contacts_suffered']} suffered; "
            f"nearest obstacle {_number(report['min_obstacle_distance_m'], 'm')}",
            f"replans: {report['replans']}; stops: {report['stops']}",
            f"tool speed while tracking, median: {_number(report['tool_speed_median_m_s'], 'm/s')}",
            "reaction: "
            + ("none" if reaction is None else f"p50 {reaction['p50']:.0f} ms, p95 {reaction['p95']:.0f} ms of {reaction['n']}"),
            f"tracking error at most {_number(report['tracking_error_max_rad'], 'rad')}; slipped steps: {report['slipped_steps']}",
        ]
    )


def _number(value: float | None, unit: str) -> str:
    return "none" if value is None else f"{value:.3f} {unit}"
