"""Which exposures are fused together: those of one instant, as soon as all cameras are there or the patience is over.

All times are the receiver's monotonic nanoseconds. One set is open at a time; an exposure of a later instant closes it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, Literal, TypeVar

__all__ = ["ExposureSets", "Refusal", "TimedExposure"]

P = TypeVar("P")
Refusal = Literal["unknown_camera", "from_the_future", "too_old", "too_late"]


@dataclass(frozen=True, eq=False)
class TimedExposure(Generic[P]):
    """An exposure of a named camera with whatever the caller keeps beside it."""

    camera: str
    exposure_ns: int
    payload: P


class ExposureSets(Generic[P]):
    """Collects simultaneous exposures.

    Args:
        cameras: names that are waited for.
        tolerance_s: exposures this close are simultaneous.
        deadline_s: how long a set waits after its first exposure came in.
        max_age_s: older exposures are not used.
    """

    def __init__(self, cameras: Sequence[str], *, tolerance_s: float, deadline_s: float, max_age_s: float) -> None:
        self._cameras = frozenset(cameras)
        self._tolerance_ns = round(tolerance_s * 1e9)
        self._deadline_ns = round(deadline_s * 1e9)
        self._max_age_ns = round(max_age_s * 1e9)
        self._open: dict[str, TimedExposure[P]] = {}
        self._opened_at_ns = 0
        self._closed: list[TimedExposure[P]] | None = None
        self._last_closed_ns: int | None = None
        self.n_skipped = 0

    def restart(self) -> None:
        """A camera began anew: what it says about time before counts no longer."""
        self._open.clear()
        self._last_closed_ns = None

    def add(self, exposure: TimedExposure[P], now_ns: int) -> Refusal | None:
        """Take an exposure, or say why not."""
        if exposure.camera not in self._cameras:
            return "unknown_camera"
        if exposure.exposure_ns > now_ns + self._tolerance_ns:
            return "from_the_future"
        if now_ns - exposure.exposure_ns > self._max_age_ns:
            return "too_old"
        if self._last_closed_ns is not None and exposure.exposure_ns <= self._last_closed_ns + self._tolerance_ns:
            return "too_late"
        if self._open:
            gap_ns = exposure.exposure_ns - self._instant_ns()
            if gap_ns < -self._tolerance_ns:
                return "too_late"
            if gap_ns > self._tolerance_ns:
                self._close()
        if not self._open:
            self._opened_at_ns = now_ns
        self._open[exposure.camera] = exposure
        return None

    def take(self, now_ns: int) -> list[TimedExposure[P]] | None:
        """The newest set that is complete or has waited long enough, in order of the cameras' names; None if there is none."""
        if self._open and (len(self._open) == len(self._cameras) or now_ns >= self._opened_at_ns + self._deadline_ns):
            self._close()
        taken, self._closed = self._closed, None
        if taken is None or now_ns - max(e.exposure_ns for e in taken) > self._max_age_ns:
            return None
        return taken

    @property
    def next_deadline_ns(self) -> int | None:
        """When :meth:`take` is due without a further exposure."""
        return self._opened_at_ns + self._deadline_ns if self._open else None

    def _instant_ns(self) -> int:
        return min(e.exposure_ns for e in self._open.values())

    def _close(self) -> None:
        """A set that was not taken in time gives way to the newer one."""
        self.n_skipped += self._closed is not None
        self._closed = sorted(self._open.values(), key=lambda e: e.camera)
        self._last_closed_ns = max(e.exposure_ns for e in self._closed)
        self._open = {}
