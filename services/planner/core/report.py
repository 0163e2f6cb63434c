"""What the live planner is given and what it tells of itself."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from services.planner.core.found import Way

__all__ = ["Event", "Goal", "Report"]

F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Goal:
    """Where to go: any of ``branches_rad`` (B, J), the joint vectors that reach the same pose, is as good."""

    id: str
    branches_rad: F64
    speed_scale: float


@dataclass(frozen=True)
class Event:
    """Something worth telling."""

    kind: str
    goal_id: str | None = None
    facts: dict[str, Any] = field(default_factory=dict)


@dataclass
class Report:
    """What the planner says of itself."""

    state: str = "idle"
    reason: str = ""
    rule: str | None = None
    way: Way | None = None
    refined: bool | None = None
    timing_ms: dict[str, float] = field(default_factory=dict)
    path_length_rad: float | None = None
    path_neurons: int | None = None
    reaction_ms: float | None = None
    replans: int = 0
    accepted: int = 0
    smoothing_fallbacks: int = 0
