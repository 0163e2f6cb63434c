"""How long something may have moved before the planner can act on it, from the frames that came lately."""

from __future__ import annotations

from collections import deque

__all__ = ["SeeingLag"]

FRAMES = 8  # half a second at 15 Hz: a slow moment is remembered that long; our choice


class SeeingLag:
    """What moves just after an exposure is first seen by the next one, and known when that frame has arrived."""

    def __init__(self) -> None:
        self._lags_s: deque[float] = deque(maxlen=FRAMES)
        self._exposure_s: float | None = None

    def hear(self, now_s: float, exposure_s: float) -> None:
        """A frame with its newest exposure at ``exposure_s`` arrived at ``now_s``."""
        gap_s = 0.0 if self._exposure_s is None else max(0.0, exposure_s - self._exposure_s)
        self._exposure_s = exposure_s
        self._lags_s.append(gap_s + max(0.0, now_s - exposure_s))

    @property
    def longest_s(self) -> float:
        """The longest of the last frames; zero before the first."""
        return max(self._lags_s, default=0.0)
