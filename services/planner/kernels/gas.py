"""The units of a growing neural gas in flat arrays: neighbour lists of fixed capacity, and the exact two nearest units through buckets.

Twin: a scan of all units (``tests/unit/planner_offline/test_gng.py``).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from common.kernel import copy_row, leaf

__all__ = [
    "MAX_DEGREE",
    "N_ALIVE",
    "N_FREE",
    "N_SIGNALS",
    "N_SLOTS",
    "Gas",
    "add_unit",
    "most_buckets",
    "move_unit",
    "nearest_two",
    "remove_unit",
]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]
Triple = tuple[float, float, float]
Nearest = tuple[int, float, int, float]  # best unit, its squared distance, second best, its squared distance

MAX_DEGREE = 48  # measured: largest degree 20 at 10 000 units in six dimensions; if ever full, the oldest edge makes room
FEW_UNITS = 200  # our choice: below this a plain scan beats the buckets
BUCKETS_A_UNIT = 1.4  # measured: 24 along each direction are best for 10 000 units, 48 to 72 for 100 000
FINER_AFTER = 1.5  # times as many units; our choice
ROUNDING = 1e-9  # rad; a unit on a bucket's border may round into the next one
# places in Gas.counts
N_ALIVE, N_SLOTS, N_FREE, N_SIGNALS, N_LAID_OUT = 0, 1, 2, 3, 4


class Gas(NamedTuple):
    """The state of a gas with room for C units in J dimensions; updated in place.

    Errors are stored divided by ``error_scale[0]``, so that the decay of all errors is one multiplication. ``bucket_*`` is the
    index: units in buckets along three directions of the sample space, doubly linked lists. The directions are orthonormal, so units
    are at least as far apart as their places along them. The buckets become finer as the gas grows.
    """

    weight: F64  # (C, J)
    error: F64  # (C,)
    error_scale: F64  # (1,)
    degree: I32  # (C,); -1: slot not in use
    neighbour: I32  # (C, MAX_DEGREE)
    age: I32  # (C, MAX_DEGREE)
    free: I32  # (C,) stack of slots given back
    counts: I64  # (5,) N_ALIVE N_SLOTS N_FREE N_SIGNALS N_LAID_OUT
    bucket_direction: F64  # (3, J)
    bucket_low: F64  # (3,)
    bucket_extent: F64  # (3,) of all buckets together; 0: one bucket that has no end, for samples of fewer dimensions
    bucket_width: F64  # (3,)
    bucket_shape: I64  # (3,)
    bucket_head: I32  # (most_buckets(C),)
    bucket_next: I32  # (C,)
    bucket_previous: I32  # (C,)
    bucket_of: I32  # (C,)


@leaf
def _along(gas: Gas, point: F64, k: int) -> float:
    """Place of ``point`` (J,) along direction ``k``, from the lowest bucket on."""
    total = -gas.bucket_low[k]
    for j in range(point.shape[0]):
        total += gas.bucket_direction[k, j] * point[j]
    return float(total)


@leaf
def _cell(gas: Gas, along: float, k: int) -> int:
    """Bucket along direction ``k``; the outermost ones hold what lies beyond."""
    cell = int(np.floor(along / gas.bucket_width[k]))
    return int(min(max(cell, 0), gas.bucket_shape[k] - 1))


@leaf
def _bucket(gas: Gas, point: F64) -> int:
    flat = _cell(gas, _along(gas, point, 0), 0) * gas.bucket_shape[1] + _cell(gas, _along(gas, point, 1), 1)
    return int(flat * gas.bucket_shape[2] + _cell(gas, _along(gas, point, 2), 2))


@leaf
def _link(gas: Gas, unit: int, bucket: int) -> None:
    head = gas.bucket_head[bucket]
    gas.bucket_next[unit] = head
    gas.bucket_previous[unit] = -1
    if head >= 0:
        gas.bucket_previous[head] = unit
    gas.bucket_head[bucket] = unit
    gas.bucket_of[unit] = bucket


@leaf
def _unlink(gas: Gas, unit: int) -> None:
    before, after = gas.bucket_previous[unit], gas.bucket_next[unit]
    if before >= 0:
        gas.bucket_next[before] = after
    else:
        gas.bucket_head[gas.bucket_of[unit]] = after
    if after >= 0:
        gas.bucket_previous[after] = before


@leaf
def _buckets_along(n_units: int) -> int:
    return int(max(1, round((BUCKETS_A_UNIT * n_units) ** (1.0 / 3.0))))


@leaf
def most_buckets(capacity: int) -> int:
    """Room that the buckets of ``capacity`` units need."""
    return int(_buckets_along(capacity) ** 3)


@leaf
def _lay_out(gas: Gas) -> None:
    """Buckets for as many units as there are now."""
    gas.counts[N_LAID_OUT] = gas.counts[N_ALIVE]
    for k in range(3):
        along = _buckets_along(gas.counts[N_ALIVE]) if gas.bucket_extent[k] > 0.0 else 1
        gas.bucket_shape[k] = along
        gas.bucket_width[k] = gas.bucket_extent[k] / along if gas.bucket_extent[k] > 0.0 else np.inf
    gas.bucket_head[:] = -1
    for unit in range(gas.counts[N_SLOTS]):
        if gas.degree[unit] >= 0:
            _link(gas, unit, _bucket(gas, gas.weight[unit]))


@leaf
def add_unit(gas: Gas, weight: F64, stored_error: float) -> int:
    """A new unit at ``weight`` (J,); its slot. The last slot given back is used first."""
    if gas.counts[N_FREE] > 0:
        gas.counts[N_FREE] -= 1
        unit = int(gas.free[gas.counts[N_FREE]])
    else:
        unit = int(gas.counts[N_SLOTS])
        gas.counts[N_SLOTS] += 1
    copy_row(weight, gas.weight[unit])
    gas.error[unit] = stored_error
    gas.degree[unit] = 0
    gas.counts[N_ALIVE] += 1
    if gas.counts[N_ALIVE] > FINER_AFTER * gas.counts[N_LAID_OUT]:
        _lay_out(gas)
    else:
        _link(gas, unit, _bucket(gas, weight))
    return unit


@leaf
def remove_unit(gas: Gas, unit: int) -> None:
    """Give back the slot of a unit that has no edges."""
    _unlink(gas, unit)
    gas.degree[unit] = -1
    gas.free[gas.counts[N_FREE]] = unit
    gas.counts[N_FREE] += 1
    gas.counts[N_ALIVE] -= 1


@leaf
def move_unit(gas: Gas, unit: int, point: F64, rate: float) -> None:
    """Move a unit by the share ``rate`` of the way to ``point`` (J,)."""
    for j in range(point.shape[0]):
        gas.weight[unit, j] += rate * (point[j] - gas.weight[unit, j])
    bucket = _bucket(gas, gas.weight[unit])
    if bucket != gas.bucket_of[unit]:
        _unlink(gas, unit)
        _link(gas, unit, bucket)


@leaf
def _squared_distance(weight: F64, unit: int, point: F64) -> float:
    total = 0.0
    for j in range(point.shape[0]):
        d = point[j] - weight[unit, j]
        total += d * d
    return total


@leaf
def _consider(unit: int, d: float, s1: int, d1: float, s2: int, d2: float) -> Nearest:
    """The two nearest after seeing one more unit; ties go to the lower slot."""
    if d < d1 or (d == d1 and unit < s1):
        return unit, d, s1, d1
    if d < d2 or (d == d2 and unit < s2):
        return s1, d1, unit, d
    return s1, d1, s2, d2


@leaf
def _unseen_from(along: Triple, cell: tuple[int, int, int], shape: tuple[int, int, int], width: Triple, ring: int) -> float:
    """A lower bound of the distance from a point at ``along`` in bucket ``cell`` to any unit outside the rings 0..ring around it."""
    bound = np.inf
    for k in range(3):
        if cell[k] - ring > 0:
            bound = min(bound, along[k] - (cell[k] - ring) * width[k])
        if cell[k] + ring < shape[k] - 1:
            bound = min(bound, (cell[k] + ring + 1) * width[k] - along[k])
    return bound - ROUNDING


@leaf
def _squared_gap(along: float, width: float, cell: int, other: int) -> float:
    """A lower bound of the squared distance, along one direction, from a point in ``cell`` to what lies in the buckets ``other``."""
    gap = 0.0
    if other > cell:
        gap = max(other * width - along - ROUNDING, 0.0)
    elif other < cell:
        gap = max(along - (other + 1) * width - ROUNDING, 0.0)
    return gap * gap


@leaf
def _scan(gas: Gas, point: F64) -> Nearest:
    s1, d1, s2, d2 = -1, np.inf, -1, np.inf
    for unit in range(gas.counts[N_SLOTS]):
        if gas.degree[unit] >= 0:
            s1, d1, s2, d2 = _consider(unit, _squared_distance(gas.weight, unit, point), s1, d1, s2, d2)
    return s1, d1, s2, d2


@leaf
def nearest_two(gas: Gas, point: F64) -> Nearest:
    """Best and second best unit of ``point`` (J,) with their squared distances: equal to a scan of all units, ties to the lower slot.

    Rings of buckets are searched outwards, in them only buckets that are nearer than the second best, until no ring can be.
    """
    if gas.counts[N_ALIVE] < FEW_UNITS:
        found: Nearest = _scan(gas, point)
        return found
    weight, after, head = gas.weight, gas.bucket_next, gas.bucket_head  # a call that is given all of the gas costs more than a look
    nx, ny, nz = gas.bucket_shape[0], gas.bucket_shape[1], gas.bucket_shape[2]
    wx, wy, wz = gas.bucket_width[0], gas.bucket_width[1], gas.bucket_width[2]
    px, py, pz = _along(gas, point, 0), _along(gas, point, 1), _along(gas, point, 2)
    cx, cy, cz = _cell(gas, px, 0), _cell(gas, py, 1), _cell(gas, pz, 2)
    s1, d1, s2, d2 = -1, np.inf, -1, np.inf
    for ring in range(max(nx, ny, nz)):
        for x in range(max(cx - ring, 0), min(cx + ring, nx - 1) + 1):
            gap_x = _squared_gap(px, wx, cx, x)
            for y in range(max(cy - ring, 0), min(cy + ring, ny - 1) + 1):
                gap_xy = gap_x + _squared_gap(py, wy, cy, y)
                if gap_xy > d2:
                    continue
                on_shell = abs(x - cx) == ring or abs(y - cy) == ring
                step = 1 if on_shell or ring == 0 else 2 * ring
                for z in range(cz - ring, cz + ring + 1, step):
                    if z < 0 or z >= nz or gap_xy + _squared_gap(pz, wz, cz, z) > d2:
                        continue
                    unit = int(head[(x * ny + y) * nz + z])
                    while unit >= 0:
                        s1, d1, s2, d2 = _consider(unit, _squared_distance(weight, unit, point), s1, d1, s2, d2)
                        unit = int(after[unit])
        bound = _unseen_from((px, py, pz), (cx, cy, cz), (nx, ny, nz), (wx, wy, wz), ring)
        if bound > 0.0 and d2 < bound * bound:
            break
    return s1, d1, s2, d2
