"""Watches distances, contacts and tracking over time, on top of the physics world; what ``robot/clearance`` answers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.robot_sim.adapters.bullet import Nearest, World
from services.robot_sim.config import RobotSimConfig
from services.robot_sim.core.contacts import Contact, ContactLog

__all__ = ["Monitor", "Snapshot"]

F64 = NDArray[np.float64]
FAR_M = 3.0  # reach of a look on request: beyond any arm on a table


@dataclass(frozen=True)
class Snapshot:
    """Nearest pairs of this moment; None: nothing within reach."""

    obstacle: Nearest | None
    static: Nearest | None
    own: Nearest | None

    @property
    def world(self) -> Nearest | None:
        """The nearest of all that is not the arm."""
        found = [n for n in (self.obstacle, self.static) if n is not None]
        return min(found, key=lambda n: n.distance_m, default=None)


class Monitor:
    """Smallest distances, largest tracking error and contacts since the last reset."""

    def __init__(self, world: World, config: RobotSimConfig) -> None:
        self._world = world
        self._config = config
        self._look_period_ns = round(1e9 / config.clearance_hz)
        self.contacts = ContactLog(config.contact_gap_s, config.caused_speed_m_s)
        self.reset()

    def reset(self) -> None:
        """Forget all."""
        self.contacts.reset()
        self.tracking_error_max_rad = 0.0
        self.min_world_m: float | None = None
        self.min_obstacle_m: float | None = None
        self._next_look_ns = 0

    def after_cycle(self, now_ns: int, q_rad: F64, q_reference_rad: F64, dq_reference_rad_s: F64) -> list[Contact]:
        """Take notice of a control cycle: (J,) measured place, commanded place and velocity at ``now_ns``. Returns contacts that begin."""
        self.tracking_error_max_rad = max(self.tracking_error_max_rad, float(np.abs(q_rad - q_reference_rad).max()))
        begun = self.contacts.observe(now_ns, self._world.touches(q_rad, dq_reference_rad_s))
        if now_ns >= self._next_look_ns:
            self._next_look_ns = now_ns + self._look_period_ns
            reach = self._config.clearance_reach_m
            self._remember(Snapshot(self._world.nearest_obstacle(reach), self._world.nearest_static(reach), None))
        return begun

    def look(self) -> Snapshot:
        """The distances now, whatever they are."""
        snapshot = Snapshot(self._world.nearest_obstacle(FAR_M), self._world.nearest_static(FAR_M), self._world.nearest_self(FAR_M))
        self._remember(snapshot)
        return snapshot

    def _remember(self, snapshot: Snapshot) -> None:
        self.min_world_m = _smaller(self.min_world_m, snapshot.world)
        self.min_obstacle_m = _smaller(self.min_obstacle_m, snapshot.obstacle)


def _smaller(known_m: float | None, seen: Nearest | None) -> float | None:
    if seen is None:
        return known_m
    return seen.distance_m if known_m is None else min(known_m, seen.distance_m)
