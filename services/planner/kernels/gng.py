"""Growing neural gas in flat arrays: exact nearest units through a bucket grid, neighbour lists of fixed capacity.

The obvious twin is ``tests/support/slow_gng.py``; both give equal networks for equal signals.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

__all__ = ["MAX_DEGREE", "N_ALIVE", "N_FREE", "N_SIGNALS", "N_SLOTS", "Gas", "add_unit", "connect", "nearest_two", "present", "refresh"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]
Nearest = tuple[int, float, int, float]  # best unit, its squared distance, second best, its squared distance

MAX_DEGREE = 48  # measured: largest degree 20 at 10 000 units in six dimensions; if ever full, the oldest edge makes room
FEW_UNITS = 200  # our choice: below this a plain scan beats the buckets
ROUNDING = 1e-9  # rad; a unit on a bucket's border may round into the next one
# places in Gas.counts
N_ALIVE, N_SLOTS, N_FREE, N_SIGNALS = 0, 1, 2, 3


class Gas(NamedTuple):
    """The state of a gas with room for C units in J dimensions; updated in place.

    Errors are stored divided by ``error_scale[0]``, so that the decay of all errors is one multiplication. ``bucket_*`` is the
    index: units in cells of three axes of the sample space, doubly linked lists.
    """

    weight: F64  # (C, J)
    error: F64  # (C,)
    error_scale: F64  # (1,)
    degree: I32  # (C,); -1: slot not in use
    neighbour: I32  # (C, MAX_DEGREE)
    age: I32  # (C, MAX_DEGREE)
    free: I32  # (C,) stack of slots given back
    counts: I64  # (4,) N_ALIVE N_SLOTS N_FREE N_SIGNALS
    bucket_axis: I64  # (3,)
    bucket_low: F64  # (3,)
    bucket_width: F64  # (3,)
    bucket_shape: I64  # (3,)
    bucket_head: I32  # (buckets,)
    bucket_next: I32  # (C,)
    bucket_previous: I32  # (C,)
    bucket_of: I32  # (C,)


@njit(cache=True, nogil=True)
def _axis_cell(gas: Gas, point: F64, k: int) -> int:
    cell = int(np.floor((point[gas.bucket_axis[k]] - gas.bucket_low[k]) / gas.bucket_width[k]))
    return int(min(max(cell, 0), gas.bucket_shape[k] - 1))


@njit(cache=True, nogil=True)
def _bucket(gas: Gas, point: F64) -> int:
    flat = _axis_cell(gas, point, 0) * gas.bucket_shape[1] + _axis_cell(gas, point, 1)
    return int(flat * gas.bucket_shape[2] + _axis_cell(gas, point, 2))


@njit(cache=True, nogil=True)
def _link(gas: Gas, unit: int, bucket: int) -> None:
    head = gas.bucket_head[bucket]
    gas.bucket_next[unit] = head
    gas.bucket_previous[unit] = -1
    if head >= 0:
        gas.bucket_previous[head] = unit
    gas.bucket_head[bucket] = unit
    gas.bucket_of[unit] = bucket


@njit(cache=True, nogil=True)
def _unlink(gas: Gas, unit: int) -> None:
    before, after = gas.bucket_previous[unit], gas.bucket_next[unit]
    if before >= 0:
        gas.bucket_next[before] = after
    else:
        gas.bucket_head[gas.bucket_of[unit]] = after
    if after >= 0:
        gas.bucket_previous[after] = before


@njit(cache=True, nogil=True)
def add_unit(gas: Gas, weight: F64, stored_error: float) -> int:
    """A new unit at ``weight`` (J,); its slot. The last slot given back is used first."""
    if gas.counts[N_FREE] > 0:
        gas.counts[N_FREE] -= 1
        unit = int(gas.free[gas.counts[N_FREE]])
    else:
        unit = int(gas.counts[N_SLOTS])
        gas.counts[N_SLOTS] += 1
    gas.weight[unit] = weight
    gas.error[unit] = stored_error
    gas.degree[unit] = 0
    gas.counts[N_ALIVE] += 1
    _link(gas, unit, _bucket(gas, weight))
    return unit


@njit(cache=True, nogil=True)
def _remove_unit(gas: Gas, unit: int) -> None:
    _unlink(gas, unit)
    gas.degree[unit] = -1
    gas.free[gas.counts[N_FREE]] = unit
    gas.counts[N_FREE] += 1
    gas.counts[N_ALIVE] -= 1


@njit(cache=True, nogil=True)
def _place(gas: Gas, a: int, b: int) -> int:
    for k in range(gas.degree[a]):
        if gas.neighbour[a, k] == b:
            return k
    return -1


@njit(cache=True, nogil=True)
def _forget(gas: Gas, a: int, b: int) -> None:
    """Take b from a's list, keeping the order of the others."""
    k = _place(gas, a, b)
    for i in range(k, gas.degree[a] - 1):
        gas.neighbour[a, i] = gas.neighbour[a, i + 1]
        gas.age[a, i] = gas.age[a, i + 1]
    gas.degree[a] -= 1


@njit(cache=True, nogil=True)
def _disconnect(gas: Gas, a: int, b: int) -> None:
    _forget(gas, a, b)
    _forget(gas, b, a)


@njit(cache=True, nogil=True)
def _make_room(gas: Gas, a: int) -> None:
    if gas.degree[a] == MAX_DEGREE:
        oldest = 0
        for k in range(1, MAX_DEGREE):
            if gas.age[a, k] > gas.age[a, oldest]:
                oldest = k
        _disconnect(gas, a, int(gas.neighbour[a, oldest]))


@njit(cache=True, nogil=True)
def _append(gas: Gas, a: int, b: int, age: int) -> None:
    gas.neighbour[a, gas.degree[a]] = b
    gas.age[a, gas.degree[a]] = age
    gas.degree[a] += 1


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True)
def _squared_distance(gas: Gas, unit: int, point: F64) -> float:
    total = 0.0
    for j in range(point.shape[0]):
        d = point[j] - gas.weight[unit, j]
        total += d * d
    return total


@njit(cache=True, nogil=True)
def _consider(unit: int, d: float, s1: int, d1: float, s2: int, d2: float) -> Nearest:
    """The two nearest after seeing one more unit; ties go to the lower slot."""
    if d < d1 or (d == d1 and unit < s1):
        return unit, d, s1, d1
    if d < d2 or (d == d2 and unit < s2):
        return s1, d1, unit, d
    return s1, d1, s2, d2


@njit(cache=True, nogil=True)
def _unseen_from(gas: Gas, point: F64, cell: tuple[int, int, int], ring: int) -> float:
    """A lower bound of the distance from ``point`` to any unit outside the rings 0..ring around its bucket."""
    bound = np.inf
    for k in range(3):
        x = point[gas.bucket_axis[k]] - gas.bucket_low[k]
        if cell[k] - ring > 0:
            bound = min(bound, x - (cell[k] - ring) * gas.bucket_width[k])
        if cell[k] + ring < gas.bucket_shape[k] - 1:
            bound = min(bound, (cell[k] + ring + 1) * gas.bucket_width[k] - x)
    return bound - ROUNDING


@njit(cache=True, nogil=True)
def _scan(gas: Gas, point: F64) -> Nearest:
    s1, d1, s2, d2 = -1, np.inf, -1, np.inf
    for unit in range(gas.counts[N_SLOTS]):
        if gas.degree[unit] >= 0:
            s1, d1, s2, d2 = _consider(unit, _squared_distance(gas, unit, point), s1, d1, s2, d2)
    return s1, d1, s2, d2


@njit(cache=True, nogil=True)
def nearest_two(gas: Gas, point: F64) -> Nearest:
    """Best and second best unit of ``point`` (J,) with their squared distances: equal to a scan of all units, ties to the lower slot."""
    if gas.counts[N_ALIVE] < FEW_UNITS:
        found: Nearest = _scan(gas, point)
        return found
    s1, d1, s2, d2 = -1, np.inf, -1, np.inf
    cx, cy, cz = _axis_cell(gas, point, 0), _axis_cell(gas, point, 1), _axis_cell(gas, point, 2)
    nx, ny, nz = gas.bucket_shape[0], gas.bucket_shape[1], gas.bucket_shape[2]
    for ring in range(max(nx, ny, nz)):
        for x in range(max(cx - ring, 0), min(cx + ring, nx - 1) + 1):
            for y in range(max(cy - ring, 0), min(cy + ring, ny - 1) + 1):
                on_shell = abs(x - cx) == ring or abs(y - cy) == ring
                step = 1 if on_shell or ring == 0 else 2 * ring
                for z in range(cz - ring, cz + ring + 1, step):
                    if z < 0 or z >= nz:
                        continue
                    unit = int(gas.bucket_head[(x * ny + y) * nz + z])
                    while unit >= 0:
                        s1, d1, s2, d2 = _consider(unit, _squared_distance(gas, unit, point), s1, d1, s2, d2)
                        unit = int(gas.bucket_next[unit])
        bound = _unseen_from(gas, point, (cx, cy, cz), ring)
        if bound > 0.0 and d2 < bound * bound:
            break
    return s1, d1, s2, d2


@njit(cache=True, nogil=True)
def _move(gas: Gas, unit: int, point: F64, rate: float) -> None:
    for j in range(point.shape[0]):
        gas.weight[unit, j] += rate * (point[j] - gas.weight[unit, j])
    bucket = _bucket(gas, gas.weight[unit])
    if bucket != gas.bucket_of[unit]:
        _unlink(gas, unit)
        _link(gas, unit, bucket)


@njit(cache=True, nogil=True)
def _drop_old_edges(gas: Gas, unit: int, max_age: int) -> None:
    k = 0
    while k < gas.degree[unit]:
        if gas.age[unit, k] > max_age:
            other = int(gas.neighbour[unit, k])
            _disconnect(gas, unit, other)
            if gas.degree[other] == 0:
                _remove_unit(gas, other)
        else:
            k += 1


@njit(cache=True, nogil=True)
def _insert(gas: Gas, alpha: float) -> None:
    q = -1
    for unit in range(gas.counts[N_SLOTS]):  # 10 us a scan of 10 000 units, once in lambda signals: no heap needed
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


@njit(cache=True, nogil=True)
def _decay(gas: Gas, factor: float) -> None:
    gas.error_scale[0] *= factor
    if gas.error_scale[0] < 1e-100:  # before the stored values overflow
        gas.error[:] = gas.error * gas.error_scale[0]
        gas.error_scale[0] = 1.0


@njit(cache=True, nogil=True)
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
        _move(gas, s1, x, e_best)
        for k in range(gas.degree[s1]):
            _move(gas, int(gas.neighbour[s1, k]), x, e_neighbour)
        connect(gas, s1, s2, 0)
        _drop_old_edges(gas, s1, max_age)
        gas.counts[N_SIGNALS] += 1
        if gas.counts[N_SIGNALS] % every == 0:
            _insert(gas, alpha)
        _decay(gas, decay)
    return int(order.shape[0])


@njit(cache=True, nogil=True)
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
                _remove_unit(gas, unit)
