"""When a process that ended is started again. Pure: time is an argument."""

from __future__ import annotations

from dataclasses import dataclass, field

__all__ = ["Backoff"]

FIRST_DELAY_S = 0.2  # our choice: a single crash should cost the cell next to nothing
FACTOR = 2.0
LONGEST_DELAY_S = 10.0  # our choice
HEALTHY_AFTER_S = 20.0  # our choice: who served this long starts again with the first delay


@dataclass
class Backoff:
    """Delay before the next start: doubles with each early end, begins anew after a healthy run."""

    _delay_s: float = field(default=FIRST_DELAY_S)

    def after_exit(self, served_s: float) -> float:
        """Seconds to wait now, ``served_s`` being how long the process had been ready (0: never)."""
        if served_s >= HEALTHY_AFTER_S:
            self._delay_s = FIRST_DELAY_S
        delay_s = self._delay_s
        self._delay_s = min(self._delay_s * FACTOR, LONGEST_DELAY_S)
        return delay_s
