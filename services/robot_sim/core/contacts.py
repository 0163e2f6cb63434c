"""Contacts as the protocol counts them: events, each caused by the arm or suffered."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

__all__ = ["Contact", "ContactLog", "Touch"]


@dataclass(frozen=True)
class Touch:
    """A part of the arm touches something at this instant.

    Attributes:
        part: body of the arm.
        other: obstacle, fixed thing, or another body of the arm.
        blameless: ``other`` is an obstacle, which may have come by itself; table, bins and the arm itself never do.
        approach_m_s: commanded speed of the arm's own contact point along the contact normal towards the other.
    """

    part: str
    other: str
    blameless: bool
    approach_m_s: float


@dataclass(frozen=True)
class Contact:
    """An event at its first touch; of several parts the one that moved fastest towards the other."""

    touch: Touch
    is_caused: bool


class ContactLog:
    """Counts events since the last reset. One event: the arm touches one thing, whichever part does, with gaps below ``gap_s``."""

    def __init__(self, gap_s: float, caused_speed_m_s: float) -> None:
        self._gap_ns = round(gap_s * 1e9)
        self._caused_speed_m_s = caused_speed_m_s
        self.reset()

    def reset(self) -> None:
        """Forget all."""
        self.caused = 0
        self.suffered = 0
        self.pairs: dict[tuple[str, str], None] = {}
        self._last_ns: dict[str, int] = {}

    def observe(self, now_ns: int, touches: Iterable[Touch]) -> list[Contact]:
        """All touches of one instant; instants must not go back. Returns the events that begin here."""
        begun = []
        by_other: dict[str, list[Touch]] = {}
        for touch in touches:
            self.pairs[touch.part, touch.other] = None
            by_other.setdefault(touch.other, []).append(touch)
        for other, here in by_other.items():
            last_ns = self._last_ns.get(other)
            self._last_ns[other] = now_ns
            if last_ns is not None and now_ns - last_ns < self._gap_ns:
                continue
            fastest = max(here, key=lambda t: (not t.blameless, t.approach_m_s))
            is_caused = not fastest.blameless or fastest.approach_m_s > self._caused_speed_m_s
            self.caused += is_caused
            self.suffered += not is_caused
            begun.append(Contact(fastest, is_caused))
        return begun
