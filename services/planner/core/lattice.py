"""What SOM and gamma-SOM share: units on a lattice of rows and columns, where they begin, and the map they become."""

from __future__ import annotations

from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from services.planner.core.cognitive_map import CognitiveMap
from services.planner.kernels import som as kernel

__all__ = ["LatticeModel", "checked_lattice", "lattice_edges", "lattice_of", "principal_plane"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

PLANE_DECIMALS = 9  # our choice: nanoradians, so that the last bits of this machine's linear algebra do not reach the map


class LatticeModel:
    """A model of ``rows`` x ``columns`` units, each joined with its 4 or 8 neighbours on the lattice.

    Unit r * columns + c stands at row r and column c.
    """

    def __init__(self, rows: int, columns: int, n_neighbours: int) -> None:
        self.rows = rows
        self.columns = columns
        self.n_neighbours = n_neighbours
        self._map: CognitiveMap | None = None

    def partial_fit(self, samples_rad: F64, seed: int, n_signals: int | None = None) -> NoReturn:
        """A lattice cannot be extended: it has no unit to spare, and moving those it has would tear up what they stand for.

        Raises:
            ValueError: always.
        """
        del samples_rad, seed, n_signals
        raise ValueError(f"a lattice of {self.rows} x {self.columns} units has a fixed size and cannot be extended: fit all samples anew")

    def to_map(self) -> CognitiveMap:
        """All units, also those that never win, and the edges of the lattice.

        Raises:
            ValueError: not fitted yet.
        """
        if self._map is None:
            raise ValueError(f"the lattice of {self.rows} x {self.columns} units is not fitted yet")
        return self._map

    def best_match(self, q_rad: F64) -> int:
        """Index of the unit nearest to ``q_rad`` (J,), by weights alone; ties go to the lower index.

        Raises:
            ValueError: not fitted yet.
        """
        return int(self.to_map().best_match(q_rad)[0])

    def _keep(self, weight_rad: F64) -> None:
        self._map = CognitiveMap.of(weight_rad.copy(), lattice_edges(self.rows, self.columns, self.n_neighbours))


def checked_lattice(rows: int, columns: int, n_neighbours: int) -> None:
    """Refuse a lattice that cannot be.

    Raises:
        ValueError: fewer than two units, or neither 4 nor 8 neighbours.
    """
    if rows < 1 or columns < 1 or rows * columns < 2:
        raise ValueError(f"a lattice needs two units at least, got {rows} x {columns}")
    if n_neighbours not in (4, 8):
        raise ValueError(f"n_neighbours must be 4 or 8, got {n_neighbours}")


def lattice_edges(rows: int, columns: int, n_neighbours: int) -> I64:
    """(M, 2) pairs of units next to each other: along rows and columns, with 8 neighbours along diagonals too."""
    unit = np.arange(rows * columns).reshape(rows, columns)
    pairs = [(unit[:, :-1], unit[:, 1:]), (unit[:-1], unit[1:])]
    if n_neighbours == 8:
        pairs += [(unit[:-1, :-1], unit[1:, 1:]), (unit[:-1, 1:], unit[1:, :-1])]
    return np.concatenate([np.stack([a.ravel(), b.ravel()], axis=1) for a, b in pairs])


def principal_plane(samples: F64, rows: int, columns: int) -> F64:
    """(rows * columns, J) where the units begin: a grid on the plane of the two largest principal components (SOM Toolbox, som_lininit).

    The grid reaches one standard deviation to either side of the mean; the lattice's longer side (of equal ones the rows) lies along the
    largest component. Samples on a line, or of one joint, have no second component: units across the line begin at one place, ties and
    rounding decide which of them win, and the lattice comes to lie on the line in folds. A lattice of one row suits such data.

    Raises:
        ValueError: samples that are all the same.
    """
    if np.all(samples == samples[0]):
        raise ValueError(f"all {len(samples)} samples are the same: nothing to learn")
    mean = samples.mean(axis=0)
    variance, axes = np.linalg.eigh((samples - mean).T @ (samples - mean) / len(samples))
    extent = (axes * np.sqrt(np.maximum(variance, 0.0))).T[::-1][:2]  # largest component first
    extent = np.vstack([extent, np.zeros((2 - len(extent), samples.shape[1]))])
    largest = np.take_along_axis(extent, np.argmax(np.abs(extent), axis=1)[:, None], axis=1)
    extent = np.round(np.where(largest < 0.0, -extent, extent), PLANE_DECIMALS)  # an axis has no sign of its own
    along_rows, along_columns = extent if rows >= columns else extent[::-1]
    places = mean + _spread(rows)[:, None, None] * along_rows + _spread(columns)[None, :, None] * along_columns
    return np.ascontiguousarray(places.reshape(rows * columns, samples.shape[1]))


def _spread(n: int) -> F64:
    return np.linspace(-1.0, 1.0, n) if n > 1 else np.zeros(1)


def lattice_of(vector: F64, coefficient: F64, rows: int, columns: int) -> kernel.Lattice:
    """The kernels' lattice of units at ``vector`` (rows * columns, D), distances weighted by ``coefficient`` (D,)."""
    n_tiles = -(-rows // kernel.TILE) * -(-columns // kernel.TILE)
    lattice = kernel.Lattice(
        vector=np.ascontiguousarray(vector, dtype=np.float64),
        coefficient=np.ascontiguousarray(coefficient, dtype=np.float64),
        shape=np.array([rows, columns], dtype=np.int64),
        profile=np.zeros(max(rows, columns)),
        box_low=np.zeros((n_tiles, vector.shape[1])),
        box_high=np.zeros((n_tiles, vector.shape[1])),
    )
    kernel.fit_all_boxes(lattice)
    return lattice
