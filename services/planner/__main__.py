"""``python -m services.planner``: run the planner."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from common.bus.service import Service, Vitals, main
from common.bus.session import Bus
from common.cell import load
from common.config import plain
from services.planner.config import PlannerConfig
from services.planner.service import Planner


def _start(bus: Bus, path: Path | None, overrides: list[str], vitals: Vitals) -> tuple[Service, dict[str, Any]]:
    cell, config = load(path, "planner", PlannerConfig, overrides)
    return Planner(bus, cell, config, vitals), {**plain(cell), "planner": plain(config)}


if __name__ == "__main__":
    sys.exit(main("planner", "Plans on the cognitive map: goals and cells in, trajectories out.", _start))
