"""The gamma-SOM: a lattice whose winners depend on what came before (formulas in services/planner/core/gamma_som.py).

A unit's vector is its weight w, then its contexts c_1 .. c_K, each of J joints; a target of K + 1 parts is met and pulled as one vector.
The obvious twin is ``tests/support/slow_som.py``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.kernel import copy_row, leaf
from services.planner.kernels.som import Lattice, nearest, pull

__all__ = ["follow", "present"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]


@leaf
def _fill_target(lattice: Lattice, sample: F64, last_winner: int, beta: float, target: F64) -> None:
    """The sample and the contexts of the moment; a trajectory's first sample (``last_winner`` -1) has contexts of zero."""
    n = sample.shape[0]
    copy_row(sample, target[:n])
    if last_winner < 0:
        target[n:] = 0.0
        return
    vector = lattice.vector[last_winner]
    for k in range(n, target.shape[0]):
        target[k] = beta * vector[k] + (1.0 - beta) * vector[k - n]


@leaf
def present(lattice: Lattice, samples: F64, first: I64, stop: I64, beta: float, rate: F64, spread: F64, winner: I32, target: F64) -> None:
    """Show trajectories (T,) in the given order, each the samples ``first[t]`` to ``stop[t] - 1`` in the order of time.

    The i-th sample shown has ``rate[i]`` and ``spread[i]``. The contexts of a moment are those of the last winner as it is after its
    move. ``winner`` (S,) holds each sample's last winner (any unit before the first time) and is updated; ``target``
    ((K + 1) * J,) is scratch.
    """
    i = 0
    for t in range(first.shape[0]):
        last_winner = -1
        for sample in range(first[t], stop[t]):
            _fill_target(lattice, samples[sample], last_winner, beta, target)
            last_winner = nearest(lattice, target, winner[sample])
            pull(lattice, last_winner, target, rate[i], spread[i])
            winner[sample] = last_winner
            i += 1


@leaf
def follow(lattice: Lattice, samples: F64, first: I64, stop: I64, beta: float, winner: I32, target: F64) -> None:
    """The winners of trajectories as in :func:`present`, but nothing moves."""
    for t in range(first.shape[0]):
        last_winner = -1
        for sample in range(first[t], stop[t]):
            _fill_target(lattice, samples[sample], last_winner, beta, target)
            last_winner = nearest(lattice, target, winner[sample])
            winner[sample] = last_winner
