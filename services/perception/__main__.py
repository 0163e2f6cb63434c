"""``python -m services.perception``."""

from __future__ import annotations

import sys

from common.bus.service import main
from services.perception.service import start

if __name__ == "__main__":
    sys.exit(main("perception", "Depth images and joint states into occupied cells.", start))
