"""``python -m services.robot_sim.cameras``."""

from __future__ import annotations

import sys

from common.bus.service import main
from services.robot_sim.cameras.service import start

if __name__ == "__main__":
    sys.exit(main("cameras", "Four simulated depth cameras over the table.", start))
