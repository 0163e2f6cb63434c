"""``python -m services.robot_sim``: the simulated robot cell as a process."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from common import cell
from common.bus.service import Service, Vitals, main
from common.bus.session import Bus
from common.config import plain
from services.robot_sim.config import RobotSimConfig
from services.robot_sim.service import RobotSim


def start(bus: Bus, path: Path | None, overrides: list[str], vitals: Vitals) -> tuple[Service, dict[str, Any]]:
    """The service of a config file, with its config as plain data."""
    shared, config = cell.load(path, "robot_sim", RobotSimConfig, overrides)
    return RobotSim(bus, shared, config, vitals), {**plain(shared), "robot_sim": plain(config)}


if __name__ == "__main__":
    sys.exit(main("robot", "The simulated robot cell: physics, obstacles, trajectory executor, watchdog.", start))
