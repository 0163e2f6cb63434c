"""Deadlines of a fixed-rate loop: late cycles are caught up, a machine that fell far behind skips instead of spiralling."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Due", "Pacer"]

CATCH_UP_CYCLES = 4  # our choice: 32 ms at 125 Hz; cycles are cheap, so this much is caught up within one period


@dataclass(frozen=True)
class Due:
    """What is to be done now.

    Attributes:
        cycles: number of cycles to run.
        slipped: cycles among them, or skipped, that begin more than a period late.
        skipped_ns: time that is given up: the world's clock stands still for it.
    """

    cycles: int
    slipped: int
    skipped_ns: int


class Pacer:
    """``deadline_ns`` is the monotonic instant at which the next cycle ends and is due."""

    def __init__(self, rate_hz: float, now_ns: int) -> None:
        self.period_ns = round(1e9 / rate_hz)
        self.deadline_ns = now_ns + self.period_ns

    def due(self, now_ns: int) -> Due:
        """The cycles that are due; the caller advances the deadline once for each by :meth:`advance`."""
        behind = (now_ns - self.deadline_ns) // self.period_ns + 1
        if behind <= 0:
            return Due(0, 0, 0)
        skipped = max(behind - CATCH_UP_CYCLES, 0)
        self.deadline_ns += skipped * self.period_ns
        return Due(behind - skipped, behind - 1, skipped * self.period_ns)

    def advance(self) -> int:
        """The instant of the cycle to run now; the deadline moves on by a period."""
        instant_ns = self.deadline_ns
        self.deadline_ns += self.period_ns
        return instant_ns
