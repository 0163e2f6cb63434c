"""A lattice of units in flat arrays: exact winners through boxes of tiles, Kohonen's two ways of training.

The obvious twin is ``tests/support/slow_som.py``; both give equal winners and the same units for equal signals.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from common.kernel import kernel, leaf

__all__ = ["CUT", "FAINT", "TILE", "Lattice", "assign", "fit_all_boxes", "nearest", "present", "pull", "smooth"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]

TILE = 4  # units along a side of a tile; measured on 100 x 100 units in six dimensions: a little faster than 5 and 6
# A signal moves a unit at lattice distance d by exp(-d^2 / spread) of its rate. Only the square window of half side sqrt(CUT * spread),
# four standard deviations, is moved. What lies outside would get less than 0.02 % of all that the signal moves, and no unit there more
# than exp(-CUT) = 0.034 % of what the winner gets; a unit so far from every winner stays where the wider radius before has left it.
CUT = 8.0  # our choice
FAINT = 1e-200  # sums below this may be made of numbers without full precision; such a unit has no sample within 30 standard deviations


class Lattice(NamedTuple):
    """Units of a lattice with R rows and C columns, unit r * C + c at (r, c), each with a vector of D numbers; updated in place.

    The distance of a unit to a point is the sum of ``coefficient`` times squared differences. ``box_low`` and ``box_high`` are the index:
    the bounds of the vectors in each tile of TILE x TILE units, tiles row by row.
    """

    vector: F64  # (R * C, D)
    coefficient: F64  # (D,) not negative
    shape: I64  # (2,) R C
    profile: F64  # (max(R, C),) scratch: exp(-k^2 / spread)
    box_low: F64  # (tiles, D)
    box_high: F64  # (tiles, D)


@kernel
def _fit_box(lattice: Lattice, tile_row: int, tile_column: int) -> None:
    rows, columns = lattice.shape[0], lattice.shape[1]
    tile = tile_row * ((columns + TILE - 1) // TILE) + tile_column
    low, high = lattice.box_low[tile], lattice.box_high[tile]
    low[:] = np.inf
    high[:] = -np.inf
    for row in range(tile_row * TILE, min((tile_row + 1) * TILE, rows)):
        for column in range(tile_column * TILE, min((tile_column + 1) * TILE, columns)):
            vector = lattice.vector[row * columns + column]
            for k in range(low.shape[0]):
                low[k] = min(low[k], vector[k])
                high[k] = max(high[k], vector[k])


@leaf
def fit_all_boxes(lattice: Lattice) -> None:
    """Make the index right after vectors were set from outside."""
    for tile_row in range((lattice.shape[0] + TILE - 1) // TILE):
        for tile_column in range((lattice.shape[1] + TILE - 1) // TILE):
            _fit_box(lattice, tile_row, tile_column)


@leaf
def _distance(lattice: Lattice, unit: int, point: F64, limit: float) -> float:
    """Distance of a unit, or a part of it that is above ``limit`` already."""
    total = 0.0
    for k in range(point.shape[0]):
        d = point[k] - lattice.vector[unit, k]
        total += lattice.coefficient[k] * (d * d)
        if total > limit:
            break
    return total


@leaf
def _is_beyond(lattice: Lattice, tile: int, point: F64, limit: float) -> bool:
    """Whether every unit of a tile is farther than ``limit``.

    Never wrong by rounding: a unit's terms are computed the same way from differences that are at least as large, and rounding keeps order.
    """
    total = 0.0
    for k in range(point.shape[0]):
        d = max(lattice.box_low[tile, k] - point[k], point[k] - lattice.box_high[tile, k], 0.0)
        total += lattice.coefficient[k] * (d * d)
        if total > limit:
            return True
    return False


@leaf
def nearest(lattice: Lattice, point: F64, hint: int) -> int:
    """The unit nearest to ``point`` (D,): equal to a scan of all units, ties to the lower one, whatever the ``hint``.

    A hint that is nearly right (the winner of the same sample last time) makes it fast.
    """
    rows, columns = lattice.shape[0], lattice.shape[1]
    best, best_distance = hint, _distance(lattice, hint, point, np.inf)
    tile = 0
    for first_row in range(0, rows, TILE):
        for first_column in range(0, columns, TILE):
            if not _is_beyond(lattice, tile, point, best_distance):
                for row in range(first_row, min(first_row + TILE, rows)):
                    for column in range(first_column, min(first_column + TILE, columns)):
                        unit = row * columns + column
                        d = _distance(lattice, unit, point, best_distance)
                        if d < best_distance or (d == best_distance and unit < best):
                            best, best_distance = unit, d
            tile += 1
    return best


@leaf
def pull(lattice: Lattice, winner: int, target: F64, rate: float, spread: float) -> None:
    """Move the winner and its neighbours towards ``target`` (D,) by ``rate * exp(-d^2 / spread)``, d in steps of the lattice (see CUT)."""
    rows, columns = lattice.shape[0], lattice.shape[1]
    reach = int(min(np.sqrt(CUT * spread), lattice.profile.shape[0] - 1))
    for k in range(reach + 1):
        lattice.profile[k] = np.exp(-k * k / spread)
    row, column = winner // columns, winner % columns
    top, bottom = max(row - reach, 0), min(row + reach, rows - 1)
    left, right = max(column - reach, 0), min(column + reach, columns - 1)
    for r in range(top, bottom + 1):
        for c in range(left, right + 1):
            share = rate * (lattice.profile[abs(r - row)] * lattice.profile[abs(c - column)])
            vector = lattice.vector[r * columns + c]
            for k in range(target.shape[0]):
                vector[k] += share * (target[k] - vector[k])
    for tile_row in range(top // TILE, bottom // TILE + 1):
        for tile_column in range(left // TILE, right // TILE + 1):
            _fit_box(lattice, tile_row, tile_column)


@leaf
def present(lattice: Lattice, samples: F64, order: I64, rate: F64, spread: F64, winner: I32) -> None:
    """Sequential training: show ``samples[order]`` (S, D), the i-th with ``rate[i]`` and ``spread[i]``.

    ``winner`` (S,) holds each sample's last winner (any unit before the first time) and is updated.
    """
    for i in range(order.shape[0]):
        sample = order[i]
        winner[sample] = nearest(lattice, samples[sample], winner[sample])
        pull(lattice, winner[sample], samples[sample], rate[i], spread[i])


@leaf
def assign(lattice: Lattice, samples: F64, winner: I32, total: F64) -> None:
    """First half of a batch epoch: into ``total`` (R * C, D + 1) the sum of the samples that each unit wins, and last their number.

    ``winner`` (S,) as in :func:`present`.
    """
    total[:] = 0.0
    n = samples.shape[1]
    for i in range(samples.shape[0]):
        unit = nearest(lattice, samples[i], winner[i])
        winner[i] = unit
        for k in range(n):
            total[unit, k] += samples[i, k]
        total[unit, n] += 1.0


@leaf
def _smooth_along(source: F64, profile: F64, out: F64) -> None:
    """``out[i] = sum over j of profile[|i - j|] * source[j]`` along the first axis of (n, m, D + 1)."""
    out[:] = 0.0
    for i in range(source.shape[0]):
        for j in range(source.shape[0]):
            weight = profile[abs(i - j)]
            if weight > 0.0:
                for m in range(source.shape[1]):
                    for k in range(source.shape[2]):
                        out[i, m, k] += weight * source[j, m, k]


@kernel
def smooth(lattice: Lattice, total: F64, scratch: F64, spread: float) -> None:
    """Second half: each unit becomes the mean of all samples, those won at lattice distance d counting exp(-d^2 / spread).

    The Gaussian of a distance is that of the rows times that of the columns, so two passes along one axis each do what all pairs of units
    would; nothing is cut off. A unit without samples near enough to count (FAINT) stays. ``total`` (R * C, D + 1) from
    :func:`assign` is overwritten, as is ``scratch`` of the same shape.
    """
    rows, columns = lattice.shape[0], lattice.shape[1]
    n = lattice.vector.shape[1]
    for k in range(lattice.profile.shape[0]):
        lattice.profile[k] = np.exp(-k * k / spread)
    by_row, passed = total.reshape(rows, columns, n + 1), scratch.reshape(rows, columns, n + 1)
    _smooth_along(by_row, lattice.profile, passed)
    for row in range(rows):  # one row is (columns, 1, D + 1)
        line = passed[row].copy().reshape(columns, 1, n + 1)
        _smooth_along(line, lattice.profile, by_row[row].reshape(columns, 1, n + 1))
    for unit in range(rows * columns):
        if total[unit, n] > FAINT:
            for k in range(n):
                lattice.vector[unit, k] = total[unit, k] / total[unit, n]
    fit_all_boxes(lattice)
