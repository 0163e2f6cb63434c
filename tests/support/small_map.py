"""A map that is built in half a minute: fewer motions, fewer neurons, everything else as shipped."""

from __future__ import annotations

import subprocess
import sys

from tests.support.repository import ROOT

__all__ = ["SMALL_MAP", "build_small_map"]

SMALL_MAP = ("planner.map.n_neurons=1500", "planner.motions.n_trajectories=150", "planner.motions.n_samples=8000")
BUILD_WITHIN_S = 600.0  # the first build on a machine compiles every kernel


def build_small_map() -> None:
    """Make it, with nothing else running, so that no stack waits for it; nothing to do when it is in the cache."""
    overrides = [word for value in SMALL_MAP for word in ("--set", value)]
    command = [sys.executable, "-m", "clients.cli.main", "build", *overrides]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True, timeout=BUILD_WITHIN_S)
