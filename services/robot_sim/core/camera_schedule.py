"""When the shutters open: at multiples of the frame period, rendered a little later; what was missed is skipped, never caught up."""

from __future__ import annotations

__all__ = ["Schedule"]


class Schedule:
    """Exposure instants on the monotonic clock, numbered by the period they begin.

    Args:
        rate_hz: exposures a second.
        delay_s: from the exposure to the moment when the state around it can be known.
    """

    def __init__(self, rate_hz: float, delay_s: float) -> None:
        self._period_ns = round(1e9 / rate_hz)
        self._delay_ns = round(delay_s * 1e9)
        self._next_frame: int | None = None
        self._first_frame = 0
        self.n_skipped = 0

    def due(self, now_ns: int) -> tuple[int, int] | None:
        """``(exposure_ns, frame)`` if one is to be rendered now; frames count from 0 at the first call."""
        newest = (now_ns - self._delay_ns) // self._period_ns
        if self._next_frame is None:
            self._next_frame = self._first_frame = newest + 1
        if newest < self._next_frame:
            return None
        self.n_skipped += newest - self._next_frame
        self._next_frame = newest + 1
        return newest * self._period_ns, newest - self._first_frame

    @property
    def next_due_ns(self) -> int | None:
        """Monotonic moment at which :meth:`due` answers next; None before its first call."""
        return None if self._next_frame is None else self._next_frame * self._period_ns + self._delay_ns
