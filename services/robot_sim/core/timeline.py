"""What the arm drives and when: trajectories in a row, each taking over from the one before at an instant.

Instants are monotonic nanoseconds. Before the first knot and after the last of a trajectory the arm rests there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from common.robot.curves import cut, join
from common.robot.trajectory import JointTrajectory

__all__ = ["Segment", "Timeline"]

F64 = NDArray[np.float64]
NS = 1_000_000_000


@dataclass(frozen=True, eq=False)
class Segment:
    """One trajectory: ``start_ns`` is the instant of its time 0, ``takeover_ns`` when it begins to be driven."""

    id: str
    kind: Literal["motion", "stop"]
    curve: JointTrajectory
    start_ns: int
    takeover_ns: int

    @property
    def end_ns(self) -> int:
        """Instant of its last knot."""
        return self.start_ns + round(self.curve.duration_s * NS)

    def instant_ns(self, time_s: float) -> int:
        """The instant of a time along it."""
        return self.start_ns + round(time_s * NS)

    def state(self, at_ns: int) -> tuple[F64, F64]:
        """Position and velocity (J,) at an instant."""
        q, dq, _ = self.curve.sample((at_ns - self.start_ns) / NS)
        return q, dq


@dataclass(frozen=True, eq=False)
class Timeline:
    """Segments in the order of their takeovers; the first has taken over already."""

    segments: tuple[Segment, ...]

    @staticmethod
    def standing(q_rad: F64, now_ns: int, id: str = "") -> Timeline:
        """Rest at ``q_rad`` (J,)."""
        q = np.array(q_rad, dtype=np.float64)[None]
        return Timeline((Segment(id, "motion", JointTrajectory(np.zeros(1), q, np.zeros_like(q)), now_ns, now_ns),))

    @property
    def newest(self) -> Segment:
        """The segment that drives last."""
        return self.segments[-1]

    @property
    def end_ns(self) -> int:
        """From when on the arm rests for good."""
        return max(self.newest.end_ns, self.newest.takeover_ns)

    def active(self, at_ns: int) -> Segment:
        """The segment that drives at an instant."""
        for segment in reversed(self.segments):
            if segment.takeover_ns <= at_ns:
                return segment
        return self.segments[0]

    def state(self, at_ns: int) -> tuple[F64, F64]:
        """Position and velocity (J,) of the reference at an instant."""
        return self.active(at_ns).state(at_ns)

    def with_segment(self, segment: Segment) -> Timeline:
        """``segment`` takes over at its instant; what would have taken over later never does."""
        kept = tuple(s for s in self.segments if s.takeover_ns < segment.takeover_ns)
        return Timeline((*kept, segment)) if kept else Timeline((segment,))

    def since(self, now_ns: int) -> Timeline:
        """Without the segments that are over."""
        first = self.segments.index(self.active(now_ns))
        return self if first == 0 else Timeline(self.segments[first:])

    def later(self, by_ns: int) -> Timeline:
        """Everything ``by_ns`` later."""
        return Timeline(tuple(Segment(s.id, s.kind, s.curve, s.start_ns + by_ns, s.takeover_ns + by_ns) for s in self.segments))

    def remaining(self, now_ns: int) -> JointTrajectory:
        """All that is still to be driven, as one curve whose time 0 is now."""
        segments = self.since(now_ns).segments
        parts = []
        begin_ns = now_ns
        for i, segment in enumerate(segments):
            end_ns = segments[i + 1].takeover_ns if i + 1 < len(segments) else max(self.end_ns, begin_ns)
            parts.append(cut(segment.curve, (begin_ns - segment.start_ns) / NS, (end_ns - segment.start_ns) / NS))
            begin_ns = end_ns
        return join(parts)
