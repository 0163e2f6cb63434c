"""The map of the shipped cell, as a user has it: made once, kept in the cache."""

from __future__ import annotations

import subprocess
import sys

from tests.support.repository import ROOT

__all__ = ["build_shipped_map"]

BUILD_WITHIN_S = 600.0  # the first build on a machine compiles every kernel


def build_shipped_map() -> None:
    """Make it, with nothing else running, so that no stack waits for it; nothing to do when it is in the cache."""
    subprocess.run([sys.executable, "-m", "clients.cli.main", "build"], cwd=ROOT, check=True, capture_output=True, timeout=BUILD_WITHIN_S)
