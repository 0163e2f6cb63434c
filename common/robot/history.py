"""Where the arm was at an instant: the recent joint samples, interpolated. Depth images and joint states must be of one moment."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["JointHistory", "JointSample"]

F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class JointSample:
    """``q_rad`` (J,) at ``stamp_ns``; ``seq`` is that of the newest message it rests on."""

    stamp_ns: int
    q_rad: F64
    dq_rad_s: F64
    seq: int


class JointHistory:
    """The last samples of one arm, in the sender's own time.

    Args:
        n_joints: J.
        length: samples kept; the default holds two seconds at 125 Hz.
        max_gap_s: neighbours farther apart than this are not interpolated between (samples were lost).
        max_extrapolation_s: how far past the newest sample its velocity is trusted; 20 ms at 5 rad/s2 are 1 mrad (our choice).
        max_rate: rad/s (m/s) that no joint has: an arm that was faster from one sample to the next was put elsewhere (``robot/reset``), and
            between was nowhere. Two who interpolate there see two different arms, and one takes the other's for an obstacle. Our choice; a
            UR3 turns by 6.3 rad/s at most.
    """

    def __init__(
        self, n_joints: int, *, length: int = 256, max_gap_s: float = 0.1, max_extrapolation_s: float = 0.02, max_rate: float = 20.0
    ) -> None:
        self._n_joints = n_joints
        self._max_rate = max_rate
        self._max_gap_ns = int(max_gap_s * 1e9)
        self._max_extrapolation_ns = int(max_extrapolation_s * 1e9)
        self._samples: deque[JointSample] = deque(maxlen=length)

    def add(self, sample: JointSample) -> str | None:
        """Take a sample; what is wrong with it, or None. A stamp that does not advance means a new start: the past is forgotten."""
        expected = (self._n_joints,)
        if sample.q_rad.shape != expected or sample.dq_rad_s.shape != expected:
            return f"q_rad and dq_rad_s must have shape {expected}, got {sample.q_rad.shape} and {sample.dq_rad_s.shape}"
        if not (np.isfinite(sample.q_rad).all() and np.isfinite(sample.dq_rad_s).all()):
            return "a joint value is not finite"
        if self._samples and sample.stamp_ns <= self._samples[-1].stamp_ns:
            self._samples.clear()
        self._samples.append(sample)
        return None

    @property
    def newest_ns(self) -> int | None:
        """Stamp of the newest sample."""
        return self._samples[-1].stamp_ns if self._samples else None

    def at(self, stamp_ns: int) -> JointSample | None:
        """The arm at an instant of the sender's time; None where the samples do not reach (too old, too new, a gap, a jump)."""
        after = bisect_right(self._samples, stamp_ns, key=lambda s: s.stamp_ns)
        if after == 0:
            return None
        a = self._samples[after - 1]
        if after == len(self._samples):
            if stamp_ns - a.stamp_ns > self._max_extrapolation_ns:
                return None
            q = a.q_rad + a.dq_rad_s * ((stamp_ns - a.stamp_ns) * 1e-9)
            return JointSample(stamp_ns, q, a.dq_rad_s, a.seq)
        b = self._samples[after]
        if b.stamp_ns - a.stamp_ns > self._max_gap_ns:
            return None
        if np.abs(b.q_rad - a.q_rad).max() > self._max_rate * (b.stamp_ns - a.stamp_ns) * 1e-9:
            return a if stamp_ns == a.stamp_ns else None
        share = (stamp_ns - a.stamp_ns) / (b.stamp_ns - a.stamp_ns)
        return JointSample(stamp_ns, a.q_rad + share * (b.q_rad - a.q_rad), a.dq_rad_s + share * (b.dq_rad_s - a.dq_rad_s), b.seq)
