"""Logging to stderr, one line a record, with the process named; the supervisor merges the processes into one log."""

from __future__ import annotations

import logging
import sys
import time

__all__ = ["RateLimit", "setup"]


def setup(owner: str, *, level: str = "INFO") -> logging.Logger:
    """Configure this process's logging once and return the owner's logger."""
    handler = logging.StreamHandler(sys.stderr)
    formatter = logging.Formatter(f"%(asctime)s.%(msecs)03d {owner:<10} %(levelname)-7s %(message)s", datefmt="%H:%M:%S")
    formatter.converter = time.localtime
    handler.setFormatter(formatter)
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(level)
    return logging.getLogger(owner)


class RateLimit:
    """Says whether a repeated complaint may be logged again: once per ``period_s`` and subject, with the count in between."""

    def __init__(self, period_s: float = 5.0) -> None:
        self._period_ns = int(period_s * 1e9)
        self._seen: dict[str, tuple[int, int]] = {}

    def allow(self, subject: str, now_ns: int) -> int:
        """Number of occurrences to report now (0: keep silent)."""
        last_ns, silent = self._seen.get(subject, (now_ns - self._period_ns, 0))
        if now_ns - last_ns < self._period_ns:
            self._seen[subject] = (last_ns, silent + 1)
            return 0
        self._seen[subject] = (now_ns, 0)
        return silent + 1
