"""The process table: what runs, in which order, and from when on it counts as ready."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from common.bus.session import BusAddress

__all__ = ["PROCESSES", "Process", "StackOptions", "command_line"]


@dataclass(frozen=True)
class Process:
    """One row.

    Attributes:
        name: the owner whose liveliness token tells readiness; for a preparation merely its name in the log.
        module: what ``python -m`` runs.
        needs: rows that must be ready (a preparation: finished) before this one starts.
        ready_within_s: no token by then means that it hangs; it is killed and started again.
        is_preparation: runs once and ends, instead of serving.
        arguments: further arguments of the module.
    """

    name: str
    module: str
    needs: tuple[str, ...] = ()
    ready_within_s: float = 300.0  # our choice: numba may compile everything on the first start
    is_preparation: bool = False
    arguments: tuple[str, ...] = ()


# Cameras and perception take most of a processor core even while nothing moves: they wait until the map is built.
PROCESSES: tuple[Process, ...] = (
    Process("map", "clients.cli.main", is_preparation=True, ready_within_s=1800.0, arguments=("build",)),
    Process("robot", "services.robot_sim"),
    Process("cameras", "services.robot_sim.cameras", needs=("map", "robot")),
    Process("perception", "services.perception", needs=("map", "robot")),
    Process("planner", "services.planner", needs=("map", "robot")),
)


@dataclass(frozen=True)
class StackOptions:
    """What all processes of one stack share."""

    address: BusAddress
    config: Path | None = None
    overrides: tuple[str, ...] = ()
    log_level: str = "INFO"


def command_line(process: Process, options: StackOptions) -> list[str]:
    """The argument vector that starts a row of the table."""
    line = [sys.executable, "-m", process.module, *process.arguments]
    if options.config is not None:
        line += ["--config", str(options.config)]
    for override in options.overrides:
        line += ["--set", override]
    if not process.is_preparation:
        line += ["--connect", options.address.endpoint, "--namespace", options.address.namespace, "--log-level", options.log_level]
    return line
