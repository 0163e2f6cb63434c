"""xoshiro256** in unbounded integers, as its authors print it: the twin of services.planner.kernels.xoshiro."""

from __future__ import annotations

MASK = (1 << 64) - 1


def rotated(x: int, k: int) -> int:
    return ((x << k) | (x >> (64 - k))) & MASK


class SlowXoshiro:
    def __init__(self, state: list[int]) -> None:
        self.s = list(state)

    def uniform(self) -> float:
        s = self.s
        result = (rotated((s[1] * 5) & MASK, 7) * 9) & MASK
        t = (s[1] << 17) & MASK
        s[2] ^= s[0]
        s[3] ^= s[1]
        s[1] ^= s[2]
        s[0] ^= s[3]
        s[2] ^= t
        s[3] = rotated(s[3], 45)
        return (result >> 11) / 2**53
