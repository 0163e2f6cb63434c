"""Tables for the terminal, made of what :class:`clients.monitor.Monitor` knows."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from clients.monitor import Monitor
from common.wire.messages import PlannerStatus, RobotState, ServiceHealth, VoxelFrame

__all__ = ["channel_table", "owner_table", "stack_view", "state_lines"]

STALE_MS = 1000.0  # our choice: from here on an age is shown as a warning


def channel_table(monitor: Monitor) -> Table:
    """Rate, age and latency of each channel."""
    table = Table(title="channels", title_justify="left", box=None, padding=(0, 2, 0, 0))
    table.add_column("key")
    for heading in ("rate Hz", "age ms", "latency ms"):
        table.add_column(heading, justify="right")
    for row in monitor.figures():
        is_event = row.key in ("planner/trajectory", "planner/event")  # they come when something happens: age says nothing
        style = "yellow" if row.age_ms > STALE_MS and not is_event else None
        rate = f"{row.total} in all" if is_event else f"{row.rate_hz:.1f}"
        table.add_row(row.key, rate, f"{row.age_ms:.0f}", f"{row.latency_ms:.1f}", style=style)
    return table


def owner_table(monitor: Monitor) -> Table:
    """Who is alive and how it fares."""
    table = Table(title="processes", title_justify="left", box=None, padding=(0, 2, 0, 0))
    for heading in ("owner", "health", "median ms of its steps", "counters"):
        table.add_column(heading)
    for owner, is_alive in monitor.alive.items():
        health = monitor.health.get(owner)
        table.add_row(owner, _health_word(is_alive, health), _latencies(health), _counters(health))
    return table


def _health_word(is_alive: bool, health: ServiceHealth | None) -> Text:
    if not is_alive:
        return Text("absent", style="red")
    if health is None:
        return Text("no answer", style="yellow")
    return Text("ok", style="green") if health.ok else Text(", ".join(health.reasons), style="yellow")


def _latencies(health: ServiceHealth | None) -> str:
    return "" if health is None else "  ".join(f"{name} {value['p50']:.1f}" for name, value in health.latency_ms.items())


def _counters(health: ServiceHealth | None) -> str:
    return "" if health is None else "  ".join(f"{name} {n}" for name, n in health.counters.items() if n)


def state_lines(monitor: Monitor) -> Text:
    """Modes and states in words."""
    robot: RobotState | None = monitor.newest("robot/state")
    planner: PlannerStatus | None = monitor.newest("planner/status")
    voxels: VoxelFrame | None = monitor.newest("perception/voxels")
    lines = []
    if robot is not None:
        lines.append(f"robot    {robot.mode}" + (f": {robot.reason}" if robot.reason else ""))
    if planner is not None:
        lines.append(f"planner  {planner.state}" + (f": {planner.reason}" if planner.reason else ""))
        lines.append(
            f"         rules {planner.rules}, {planner.n_blocked} of {planner.n_neurons} neurons blocked, {planner.replans} replans"
        )
        lines.append("         " + "  ".join(f"{stage} {ms:.1f} ms" for stage, ms in planner.timing_ms.items()))
    if voxels is not None:
        used = ", ".join(camera.name for camera in voxels.cameras if camera.used)
        lines.append(f"voxels   {len(voxels.cells)} cells from {used or 'no camera'}")
    return Text("\n".join(lines) if lines else "nothing heard yet")


def stack_view(monitor: Monitor) -> RenderableType:
    """Everything on one screen."""
    return Group(state_lines(monitor), Text(), owner_table(monitor), Text(), channel_table(monitor))
