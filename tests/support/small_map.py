"""Overrides for a map that is built in seconds: fewer motions, fewer neurons, everything else as shipped."""

from __future__ import annotations

SMALL_MAP = ("planner.map.n_neurons=2000", "planner.motions.n_trajectories=200", "planner.motions.n_samples=10000")
