"""SOM and gamma-SOM as their formulas read, all units against all: the twin of services.planner.kernels.som and gamma_som.

Lattices are (rows, columns); unit r * columns + c stands at (r, c).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Shape = tuple[int, int]


def squared_steps(shape: Shape, unit: int) -> I64:
    """(R * C,) squared lattice distance of each unit to one."""
    rows, columns = np.divmod(np.arange(shape[0] * shape[1]), shape[1])
    return (rows - unit // shape[1]) ** 2 + (columns - unit % shape[1]) ** 2


def in_window(shape: Shape, unit: int, cut: float, spread: float) -> NDArray[np.bool_]:
    """(R * C,) whether a unit lies in the square window that sequential training moves; ``cut`` infinite: all do."""
    rows, columns = np.divmod(np.arange(shape[0] * shape[1]), shape[1])
    away = np.maximum(np.abs(rows - unit // shape[1]), np.abs(columns - unit % shape[1]))
    return away <= np.sqrt(cut * spread)


def winner_of(vector: F64, coefficient: F64, point: F64) -> int:
    distance = np.zeros(len(vector))
    for k in range(len(point)):  # summed in the kernel's order: ties are exact
        distance += coefficient[k] * (point[k] - vector[:, k]) ** 2
    return int(np.argmin(distance))


def pull(vector: F64, shape: Shape, winner: int, target: F64, rate: float, spread: float, cut: float) -> None:
    share = np.where(in_window(shape, winner, cut, spread), rate * np.exp(-squared_steps(shape, winner) / spread), 0.0)
    vector += share[:, None] * (target - vector)


def present(vector: F64, shape: Shape, signals: F64, rate: F64, spread: F64, cut: float) -> list[int]:
    """Sequential training on signals in their order; the winners."""
    winners = []
    for x, signal_rate, signal_spread in zip(signals, rate, spread, strict=True):
        winners.append(winner_of(vector, np.ones(len(x)), x))
        pull(vector, shape, winners[-1], x, signal_rate, signal_spread, cut)
    return winners


def batch_epoch(vector: F64, shape: Shape, samples: F64, spread: float, faint: float) -> F64:
    """The units after one epoch: means of all samples, weighted by the winners' lattice distance; weights up to ``faint`` move nothing."""
    winners = [winner_of(vector, np.ones(samples.shape[1]), x) for x in samples]
    weight = np.array([np.exp(-squared_steps(shape, winner) / spread) for winner in winners])  # (S, R * C)
    active = weight.sum(axis=0)
    moved = vector.copy()
    heard = active > faint
    moved[heard] = (weight.T @ samples)[heard] / active[heard, None]
    return moved


def context(weight: F64, contexts: F64, beta: float) -> F64:
    """(K, J) contexts of the moment after a winner with ``weight`` (J,) and ``contexts`` (K, J)."""
    before = [weight, *contexts]
    return np.array([beta * before[k] + (1.0 - beta) * before[k - 1] for k in range(1, len(before))]).reshape(contexts.shape)


def present_in_context(
    weight: F64, contexts: F64, shape: Shape, trajectories: list[F64], a: F64, beta: float, rate: F64, spread: F64, cut: float
) -> list[int]:
    """Gamma-SOM training on trajectories (n, J), units ``weight`` (N, J), ``contexts`` (N, K, J), distance weights ``a`` (K + 1,)."""
    winners = []
    for trajectory in trajectories:
        now = np.zeros(contexts.shape[1:])
        for x in trajectory:
            d = a[0] * np.sum((x - weight) ** 2, axis=1) + np.einsum("k,nkj->n", a[1:], (now - contexts) ** 2)
            best = int(np.argmin(d))
            n = len(winners)
            share = np.where(in_window(shape, best, cut, spread[n]), rate[n] * np.exp(-squared_steps(shape, best) / spread[n]), 0.0)
            weight += share[:, None] * (x - weight)
            contexts += share[:, None, None] * (now - contexts)
            now = context(weight[best], contexts[best], beta)
            winners.append(best)
    return winners
