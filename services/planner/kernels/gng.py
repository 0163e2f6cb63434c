"""How a growing neural gas learns: Fritzke's steps on the arrays of :mod:`services.planner.kernels.gas`.

The obvious twin is ``tests/support/slow_gng.py``; both give equal networks for equal signals.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.kernel import kernel, leaf
from services.planner.kernels.gas import MAX_DEGREE, N_ALIVE, N_SIGNALS, N_SLOTS, Gas, add_unit, move_unit, nearest_two, remove_unit

__all__ = ["connect", "present", "refresh"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


@leaf
def _place(gas: Gas, a: int, b: int) -> int:
    for k in range(gas.degree[a]):
        if gas.neighbour[a, k] == b:
            return k
    return -1


@leaf
def _forget(gas: Gas, a: int, b: int) -> None:
    """Take b from a's list, keeping the order of the others."""
    k = _place(gas, a, b)
    for i in range(k, gas.degree[a] - 1):
        gas.neighbour[a, i] = gas.neighbour[a, i + 1]
        gas.age[a, i] = gas.age[a, i + 1]
    gas.degree[a] -= 1


@leaf
def _disconnect(gas: Gas, a: int, b: int) -> None:
    _forget(gas, a, b)
    _forget(gas, b, a)


@leaf
def _make_room(gas: Gas, a: int) -> None:
    if gas.degree[a] == MAX_DEGREE:
        oldest = 0
        for k in range(1, MAX_DEGREE):
            if gas.age[a, k] > gas.age[a, oldest]:
                oldest = k
        _disconnect(gas, a, int(gas.neighbour[a, oldest]))


@leaf
def _append(gas: Gas, a: int, b: int, age: int) -> None:
    gas.neighbour[a, gas.degree[a]] = b
    gas.age[a, gas.degree[a]] = age
    gas.degree[a] += 1


@leaf
def connect(gas: Gas, a: int, b: int, age: int) -> None:
    """Make the edge a-b, or set the age of the one that is there."""
    k = _place(gas, a, b)
    if k >= 0:
        gas.age[a, k] = age
        gas.age[b, _place(gas, b, a)] = age
        return
    _make_room(gas, a)
    _make_room(gas, b)
    _append(gas, a, b, age)
    _append(gas, b, a, age)


@leaf
def _drop_old_edges(gas: Gas, unit: int, max_age: int) -> None:
    k = 0
    while k < gas.degree[unit]:
        if gas.age[unit, k] > max_age:
            other = int(gas.neighbour[unit, k])
            _disconnect(gas, unit, other)
            if gas.degree[other] == 0:
                remove_unit(gas, other)
        else:
            k += 1


@kernel
def _insert(gas: Gas, alpha: float) -> None:
    q = -1
    for unit in range(gas.counts[N_SLOTS]):  # once in lambda signals, 10 us of 10 000 units: no heap is needed
        if gas.degree[unit] > 0 and (q < 0 or gas.error[unit] > gas.error[q]):
            q = unit
    f = int(gas.neighbour[q, 0])
    for k in range(1, gas.degree[q]):
        n = int(gas.neighbour[q, k])
        if gas.error[n] > gas.error[f] or (gas.error[n] == gas.error[f] and n < f):
            f = n
    gas.error[q] *= alpha
    gas.error[f] *= alpha
    r = add_unit(gas, 0.5 * (gas.weight[q] + gas.weight[f]), gas.error[q])
    _disconnect(gas, q, f)
    connect(gas, q, r, 0)
    connect(gas, r, f, 0)


@leaf
def _decay(gas: Gas, factor: float) -> None:
    gas.error_scale[0] *= factor
    if gas.error_scale[0] < 1e-100:  # before the stored values overflow
        for unit in range(gas.error.shape[0]):
            gas.error[unit] *= gas.error_scale[0]
        gas.error_scale[0] = 1.0


@leaf
def present(
    gas: Gas,
    samples: F64,
    order: I64,
    n_target: int,
    every: int,
    e_best: float,
    e_neighbour: float,
    alpha: float,
    decay: float,
    max_age: int,
) -> int:
    """Show the signals ``samples[order]`` until the gas has ``n_target`` units; how many were shown.

    One signal is steps 2 to 9 of Fritzke (1995), section 2, in that order. Insertion falls due every ``every`` signals.
    """
    for i in range(order.shape[0]):
        if gas.counts[N_ALIVE] >= n_target:
            return i
        x = samples[order[i]]
        s1, d1, s2, _ = nearest_two(gas, x)
        for k in range(gas.degree[s1]):
            n = int(gas.neighbour[s1, k])
            gas.age[s1, k] += 1
            gas.age[n, _place(gas, n, s1)] += 1
        gas.error[s1] += d1 / gas.error_scale[0]
        move_unit(gas, s1, x, e_best)
        for k in range(gas.degree[s1]):
            move_unit(gas, int(gas.neighbour[s1, k]), x, e_neighbour)
        connect(gas, s1, s2, 0)
        _drop_old_edges(gas, s1, max_age)
        gas.counts[N_SIGNALS] += 1
        if gas.counts[N_SIGNALS] % every == 0:
            _insert(gas, alpha)
        _decay(gas, decay)
    return int(order.shape[0])


@leaf
def refresh(gas: Gas, samples: F64) -> None:
    """One pass that moves nothing: edges between the best two of some sample stay, all others go, then units without edges.

    What is left is Martinetz's competitive Hebbian graph of the final weights.
    """
    n_slots = gas.counts[N_SLOTS]
    for unit in range(n_slots):
        for k in range(max(gas.degree[unit], 0)):
            gas.age[unit, k] = 1
    for i in range(samples.shape[0]):
        s1, _, s2, _ = nearest_two(gas, samples[i])
        connect(gas, s1, s2, 0)
    for unit in range(n_slots):
        if gas.degree[unit] >= 0:
            _drop_old_edges(gas, unit, 0)
            if gas.degree[unit] == 0:
                remove_unit(gas, unit)
