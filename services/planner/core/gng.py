"""Growing neural gas (Fritzke 1995) as an estimator (:class:`services.planner.core.models.MapModel`)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.planner.core.cognitive_map import CognitiveMap
from services.planner.core.models import Progress, checked_samples
from services.planner.kernels import gas as units
from services.planner.kernels import gng as kernel

__all__ = ["GasParameters", "GrowingNeuralGas"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

CHUNK = 20_000  # signals between two reports of progress; our choice
FLAT_RAD = 1e-6  # samples that spread less along a direction are not told apart by it; our choice


@dataclass(frozen=True)
class GasParameters:
    """Fritzke's names: lambda ``insert_every``, e_b, e_n, alpha, decay of all errors a signal, a_max ``max_age``."""

    insert_every: int = 100
    e_best: float = 0.1
    e_neighbour: float = 0.006
    alpha: float = 0.5
    decay: float = 0.9995
    max_age: int = 50


class GrowingNeuralGas:
    """A gas that grows to ``n_neurons`` units on joint configurations.

    Same samples, parameters and seed give the same units and edges byte for byte.
    """

    def __init__(self, parameters: GasParameters, n_neurons: int) -> None:
        self.parameters = parameters
        self.n_neurons = n_neurons
        self._gas: units.Gas | None = None

    def fit(self, samples_rad: F64, trajectory_starts: I64, seed: int, progress: Progress | None = None) -> GrowingNeuralGas:
        """Grow from two units to ``n_neurons`` on signals drawn from ``samples_rad`` (S, J), then refresh the edges; starts are ignored.

        Raises:
            ValueError: samples not (S >= 2, J) or not finite, or all the same.
        """
        del trajectory_starts
        samples = checked_samples(samples_rad)
        rng = np.random.default_rng(seed)
        self._gas = _empty_gas(samples, self.n_neurons)
        first = rng.integers(len(samples))
        others = np.flatnonzero(np.any(samples != samples[first], axis=1))
        if len(others) == 0:
            raise ValueError("all samples are the same: nothing to learn")
        for index in (first, others[rng.integers(len(others))]):
            units.add_unit(self._gas, samples[index], 0.0)
        kernel.connect(self._gas, 0, 1, 0)  # Fritzke starts without an edge; the first signal would make it
        self._grow(samples, rng, progress)
        kernel.refresh(self._gas, samples)
        return self

    @classmethod
    def of_map(cls, kept: CognitiveMap, parameters: GasParameters, n_neurons: int, samples_rad: F64) -> GrowingNeuralGas:
        """A gas that stands as ``kept`` does, without errors and with fresh edges, ready for :meth:`partial_fit` up to ``n_neurons``.

        A kept map does not say how old its edges were or where its errors lay: edges that later signals contradict age from here on.

        Args:
            kept: of a gas; :meth:`to_map` gives it back as it is.
            parameters: of what is learned from now on.
            n_neurons: at least as many as ``kept`` has.
            samples_rad: (S, J) what will be shown, so that the search for nearest units is laid out for it.

        Raises:
            ValueError: fewer neurons than there are, samples of another width, or a neuron with more neighbours than a gas can hold.
        """
        samples = checked_samples(samples_rad)
        if samples.shape[1] != kept.q_rad.shape[1]:
            raise ValueError(f"samples have {samples.shape[1]} joints, the map has {kept.q_rad.shape[1]}")
        if n_neurons < kept.n_neurons:
            raise ValueError(f"n_neurons is {n_neurons}, the map has {kept.n_neurons} already")
        degree = int(np.bincount(kept.edges.ravel(), minlength=1).max())
        if degree > units.MAX_DEGREE:
            raise ValueError(f"a neuron of the map has {degree} neighbours, a gas holds {units.MAX_DEGREE}")
        model = cls(parameters, n_neurons)
        model._gas = _empty_gas(np.concatenate([kept.q_rad, samples]), n_neurons)
        for q in kept.q_rad:
            units.add_unit(model._gas, q, 0.0)
        for a, b in kept.edges:
            kernel.connect(model._gas, int(a), int(b), 0)
        return model

    def partial_fit(self, samples_rad: F64, seed: int, n_signals: int | None = None) -> GrowingNeuralGas:
        """Show further signals (default: as many as samples) to a fitted gas; it may grow up to ``n_neurons`` meanwhile.

        No refresh: what is not in these samples is not forgotten, edges only age where the signals fall.

        Raises:
            ValueError: not fitted yet, or samples of another width.
        """
        gas = self._fitted()
        samples = checked_samples(samples_rad)
        if samples.shape[1] != gas.weight.shape[1]:
            raise ValueError(f"samples have {samples.shape[1]} joints, the gas has {gas.weight.shape[1]}")
        rng = np.random.default_rng(seed)
        n_left = len(samples) if n_signals is None else n_signals
        while n_left > 0:
            order = rng.integers(len(samples), size=min(n_left, CHUNK))
            n_shown = self._present(samples, order, self.n_neurons)
            if n_shown < len(order):  # full: adapt without growing
                self._present(samples, order[n_shown:], self.n_neurons + 1, grow=False)
            n_left -= len(order)
        return self

    def to_map(self) -> CognitiveMap:
        """Units and edges, in the order of their slots.

        Raises:
            ValueError: not fitted yet.
        """
        gas = self._fitted()
        slots = np.flatnonzero(gas.degree[: gas.counts[units.N_SLOTS]] >= 0)
        number = np.full(len(gas.degree), -1, dtype=np.int64)
        number[slots] = np.arange(len(slots))
        edges = [(number[u], number[v]) for u in slots for v in gas.neighbour[u, : gas.degree[u]] if u < v]
        return CognitiveMap.of(gas.weight[slots], np.array(edges, dtype=np.int64))

    def best_match(self, q_rad: F64) -> int:
        """Index (as in :meth:`to_map`) of the unit nearest to ``q_rad`` (J,)."""
        gas = self._fitted()
        slot = units.nearest_two(gas, np.ascontiguousarray(q_rad, dtype=np.float64))[0]
        return int(np.count_nonzero(gas.degree[:slot] >= 0))

    def _fitted(self) -> units.Gas:
        if self._gas is None:
            raise ValueError("the gas is not fitted yet")
        return self._gas

    def _grow(self, samples: F64, rng: np.random.Generator, progress: Progress | None) -> None:
        # Units are inserted every lambda signals and removed rarely; four times that many signals means that it cannot grow.
        gas = self._fitted()
        limit = 4 * self.parameters.insert_every * self.n_neurons
        while gas.counts[units.N_ALIVE] < self.n_neurons and gas.counts[units.N_SIGNALS] < limit:
            self._present(samples, rng.integers(len(samples), size=CHUNK), self.n_neurons)
            if progress is not None:
                progress(float(gas.counts[units.N_ALIVE]) / self.n_neurons)

    def _present(self, samples: F64, order: I64, n_target: int, *, grow: bool = True) -> int:
        p = self.parameters
        every = p.insert_every if grow else np.iinfo(np.int64).max
        return int(kernel.present(self._fitted(), samples, order, n_target, every, p.e_best, p.e_neighbour, p.alpha, p.decay, p.max_age))


def _empty_gas(samples: F64, n_neurons: int) -> units.Gas:
    """Room for ``n_neurons`` units; buckets along the three directions in which the samples vary most (principal components)."""
    n_joints = samples.shape[1]
    n_directions = min(3, n_joints)
    direction = np.zeros((3, n_joints))
    direction[:n_directions] = np.linalg.eigh(np.atleast_2d(np.cov(samples, rowvar=False)))[1].T[::-1][:n_directions]
    along = samples @ direction.T
    low, extent = along.min(axis=0), np.ptp(along, axis=0)
    capacity = n_neurons + 1
    return units.Gas(
        weight=np.zeros((capacity, n_joints)),
        error=np.zeros(capacity),
        error_scale=np.ones(1),
        degree=np.full(capacity, -1, dtype=np.int32),
        neighbour=np.zeros((capacity, units.MAX_DEGREE), dtype=np.int32),
        age=np.zeros((capacity, units.MAX_DEGREE), dtype=np.int32),
        free=np.zeros(capacity, dtype=np.int32),
        counts=np.zeros(5, dtype=np.int64),
        bucket_direction=direction,
        bucket_low=low,
        bucket_extent=np.where(extent > FLAT_RAD, extent, 0.0),
        bucket_width=np.full(3, np.inf),
        bucket_shape=np.ones(3, dtype=np.int64),
        bucket_head=np.full(units.most_buckets(capacity), -1, dtype=np.int32),
        bucket_next=np.full(capacity, -1, dtype=np.int32),
        bucket_previous=np.full(capacity, -1, dtype=np.int32),
        bucket_of=np.full(capacity, -1, dtype=np.int32),
    )
