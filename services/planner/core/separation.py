"""Slowing by separation: how fast a motion may pass what is seen. The law is told at ``SeparationConfig``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.planner.core.world import World
from services.planner.kernels.collision import Arm
from services.planner.kernels.reach import Reach
from services.planner.kernels.separation import SpeedLaw, speed_caps

__all__ = ["Caps", "Separation"]

F64 = NDArray[np.float64]
# Samples of a path (N,), its points and derivatives (N, J), ds/dt without bounds (N,) -> (N,) bounds of (ds/dt)^2, infinite where none.
Caps = Callable[[F64, F64, F64, F64], F64]


@dataclass(frozen=True, eq=False)
class Separation:
    """The law for what stands and for what may belong to something that moves.

    Attributes:
        arm: the arm. reach: its coarser distance grids.
        standing, moving: the laws.
    """

    arm: Arm
    reach: Reach
    standing: SpeedLaw
    moving: SpeedLaw

    def caps(self, world: World) -> Caps:
        """Bounds of the speed along paths among the cells of ``world``."""

        def caps(s: F64, q_rad: F64, d1: F64, speed: F64) -> F64:
            cap = np.full(len(s), np.inf)
            for cells, law in ((world.cells, self.standing), (world.recent, self.moving)):
                if len(cells.flat) > 0:
                    speed_caps(self.arm, self.reach, cells, law, s, q_rad, d1, speed, cap)
            return cap

        return caps
