"""Whether the arm stands, as people who reach into its cell see it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["Bystander"]

F64 = NDArray[np.float64]


class Bystander:
    """Takes the arm for standing from the moment when it stands until its motion could be seen and reacted to."""

    def __init__(self, standing_rad_s: float, reaction_s: float) -> None:
        self._standing_rad_s = standing_rad_s
        self._reaction_ns = round(reaction_s * 1e9)
        self._stood_ns: int | None = None

    def look(self, at_ns: int, dq_rad_s: F64) -> None:
        """The joints move so at ``at_ns``."""
        if float(np.abs(dq_rad_s).max()) < self._standing_rad_s:
            self._stood_ns = at_ns

    def sees_it_stand(self, at_ns: int) -> bool:
        """True before the first look too."""
        return self._stood_ns is None or at_ns - self._stood_ns < self._reaction_ns
