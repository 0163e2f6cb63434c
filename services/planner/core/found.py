"""What a search for a path answers: a path, or why there is none."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from services.planner.core.world import Leaving

__all__ = ["NO_NEURON", "FoundPath", "NotFound", "Way", "path_length"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
Way = Literal["map", "repair", "fallback"]
NO_NEURON = -1  # stands in a path's neurons for a point that is none


@dataclass(frozen=True, eq=False)
class FoundPath:
    """A free path.

    Attributes:
        neurons: (N,) int32 neurons on the way, :data:`NO_NEURON` for a point that is none; may be empty (a straight line).
        q_rad: (N + 2, J) true start, the points of ``neurons``, true goal.
        leaving: the cells among which the arm stands at the start and which it must move away from; None = it stands free.
        way: what found it.
    """

    neurons: I32
    q_rad: F64
    leaving: Leaving | None = None
    way: Way = "map"

    @cached_property
    def length_rad(self) -> float:
        """Euclidean joint length of ``q_rad``."""
        return path_length(self.q_rad)


@dataclass(frozen=True)
class NotFound:
    """Why there is no path: an expected outcome."""

    outcome: Literal["no_path", "start_blocked", "goal_blocked"]
    reason: str


def path_length(q_rad: F64) -> float:
    """Euclidean joint length in rad of a polyline (P, J)."""
    return float(np.linalg.norm(np.diff(q_rad, axis=0), axis=1).sum())
