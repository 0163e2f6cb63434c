"""Time: monotonic for everything that decides, UTC only to be written down.

Stamps on the wire are UTC of the machine that made them (``docs/protocol.md``). A receiver turns them into its own monotonic
clock once, on arrival, through :class:`ClockOffset`; afterwards a wall clock that steps moves nothing.
"""

from __future__ import annotations

import time
from collections import deque

__all__ = ["ClockOffset", "monotonic_ns", "utc_ns"]

# A wall clock that was stepped must be followed within seconds, and one late packet must not count. Our choice.
WINDOW_SAMPLES = 64
STEP_NS = 500_000_000


def monotonic_ns() -> int:
    """Monotonic nanoseconds of this machine: the clock of ages, deadlines and execution."""
    return time.monotonic_ns()


def utc_ns() -> int:
    """UTC nanoseconds since 1970: for logs, people and the ``*_ns`` stamps on the wire."""
    return time.time_ns()


class ClockOffset:
    """Estimates ``local monotonic - sender's UTC`` of one sender from the stamps of its messages.

    Each arrival gives ``arrival_mono - sent_utc`` = true offset + transit. Transit is never negative, so the smallest of a
    window is the best estimate (the minimum filter of NTP, RFC 5905 section 10). A jump by more than ``STEP_NS`` is a stepped
    clock: the window starts anew.
    """

    def __init__(self) -> None:
        self._window: deque[int] = deque(maxlen=WINDOW_SAMPLES)

    def observe(self, sent_utc_ns: int, arrival_mono_ns: int) -> None:
        """Take one arrival; ``sent_utc_ns`` must be the stamp of sending (or the nearest thing to it)."""
        offset = arrival_mono_ns - sent_utc_ns
        if self._window and abs(offset - min(self._window)) > STEP_NS:
            self._window.clear()
        self._window.append(offset)

    def to_monotonic(self, utc_stamp_ns: int) -> int:
        """The sender's UTC stamp on this machine's monotonic clock.

        Raises:
            ValueError: before the first :meth:`observe`.
        """
        if not self._window:
            raise ValueError("no message of this sender was observed yet")
        return utc_stamp_ns + min(self._window)

    def to_sender(self, monotonic_stamp_ns: int) -> int:
        """An instant of this machine's monotonic clock as the sender's UTC: the way back.

        Raises:
            ValueError: before the first :meth:`observe`.
        """
        return monotonic_stamp_ns - self.to_monotonic(0)
