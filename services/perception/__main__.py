"""``python -m services.perception``."""

from __future__ import annotations

import os
import sys

os.environ.setdefault("OMP_NUM_THREADS", "1")  # read when Open3D is loaded; processes share cores (measured: 4 ms CPU a set instead of 5)

from common.bus.service import main
from services.perception.service import start

if __name__ == "__main__":
    sys.exit(main("perception", "Depth images and joint states into occupied cells.", start))
