"""Growing neural gas in plain dictionaries, step by step as Fritzke (1995) numbers them: the twin of services.planner.kernels.gng."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]


class SlowGas:
    """``weight`` and ``error`` by unit, ``age`` by edge (frozenset of two units). Units given back are used again, last first."""

    def __init__(self, first: F64, second: F64) -> None:
        self.weight: dict[int, F64] = {0: first.copy(), 1: second.copy()}
        self.error: dict[int, float] = {0: 0.0, 1: 0.0}
        self.age: dict[frozenset[int], int] = {frozenset((0, 1)): 0}
        self.free: list[int] = []
        self.signals = 0

    def neighbours(self, unit: int) -> list[int]:
        return sorted(next(iter(edge - {unit})) for edge in self.age if unit in edge)

    def nearest_two(self, x: F64) -> tuple[int, int, float]:
        distance = sorted((float(np.sum((x - w) ** 2)), unit) for unit, w in self.weight.items())
        return distance[0][1], distance[1][1], distance[0][0]

    def remove_if_alone(self, unit: int) -> None:
        if not self.neighbours(unit):
            del self.weight[unit], self.error[unit]
            self.free.append(unit)

    def show(self, x: F64, every: int, e_best: float, e_neighbour: float, alpha: float, decay: float, max_age: int) -> None:
        s1, s2, d1 = self.nearest_two(x)
        for n in self.neighbours(s1):
            self.age[frozenset((s1, n))] += 1
        self.error[s1] += d1
        self.weight[s1] = self.weight[s1] + e_best * (x - self.weight[s1])
        for n in self.neighbours(s1):
            self.weight[n] = self.weight[n] + e_neighbour * (x - self.weight[n])
        self.age[frozenset((s1, s2))] = 0
        for n in self.neighbours(s1):
            if self.age[frozenset((s1, n))] > max_age:
                del self.age[frozenset((s1, n))]
                self.remove_if_alone(n)
        self.signals += 1
        if self.signals % every == 0:
            self.insert(alpha)
        for unit in self.error:
            self.error[unit] *= decay

    def insert(self, alpha: float) -> None:
        q = max(self.error, key=lambda u: (self.error[u], -u))
        f = max(self.neighbours(q), key=lambda u: (self.error[u], -u))
        r = self.free.pop() if self.free else len(self.weight)
        self.error[q] *= alpha
        self.error[f] *= alpha
        self.weight[r] = 0.5 * (self.weight[q] + self.weight[f])
        self.error[r] = self.error[q]
        del self.age[frozenset((q, f))]
        self.age[frozenset((q, r))] = 0
        self.age[frozenset((r, f))] = 0

    def refresh(self, samples: F64) -> None:
        seen = set()
        for x in samples:
            s1, s2, _ = self.nearest_two(x)
            seen.add(frozenset((s1, s2)))
        self.age = dict.fromkeys(seen, 0)
        for unit in list(self.weight):
            self.remove_if_alone(unit)
