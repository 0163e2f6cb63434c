"""Slowing by separation: how fast a motion may pass what is seen. The law is told at ``SeparationConfig``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from services.planner.core.world import World
from services.planner.kernels.cells import Cells
from services.planner.kernels.collision import Arm
from services.planner.kernels.reach import Reach
from services.planner.kernels.separation import SpeedLaw, caps_among

__all__ = ["Caps", "Separation"]

F64 = NDArray[np.float64]


class Caps(NamedTuple):
    """How fast the arm may be along any path, by the cells of one world; as the kernels are told it."""

    arm: Arm
    reach: Reach
    standing: Cells
    standing_law: SpeedLaw
    moving: Cells
    moving_law: SpeedLaw

    def along(self, s: F64, q_rad: F64, d1: F64, speed: F64) -> F64:
        """(N,) bounds of (ds/dt)^2 at samples of a path, infinite where there is none.

        Args:
            s: (N,) path parameters. q_rad, d1: (N, J) points and their derivative by ``s``.
            speed: (N,) ds/dt that the motion has where nothing bounds it.
        """
        cap = np.empty(len(s))
        caps_among(self, s, q_rad, d1, speed, cap)
        return cap


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
        return Caps(self.arm, self.reach, world.cells, self.standing, world.recent, self.moving)
