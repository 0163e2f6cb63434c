"""The generator of the planner's kernels: xoshiro256** (Blackman and Vigna 2018), its state an array that the caller owns."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.kernel import leaf

__all__ = ["uniform"]

U64 = NDArray[np.uint64]


@leaf
def _rotated(x, k):  # type: ignore[no-untyped-def]
    return (x << np.uint64(k)) | (x >> np.uint64(64 - k))


@leaf
def _next(state):  # type: ignore[no-untyped-def]
    result = _rotated(state[1] * np.uint64(5), 7) * np.uint64(9)
    t = state[1] << np.uint64(17)
    state[2] ^= state[0]
    state[3] ^= state[1]
    state[1] ^= state[2]
    state[0] ^= state[3]
    state[2] ^= t
    state[3] = _rotated(state[3], 45)
    return result


@leaf
def uniform(state: U64) -> float:
    """The next number in [0, 1), of 53 bits; ``state`` (4,) uint64, not all zero, is advanced."""
    return float((_next(state) >> np.uint64(11)) * (1.0 / 9007199254740992.0))
