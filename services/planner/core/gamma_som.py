"""The gamma-SOM of Estévez and Hernández (2009) as an estimator (:class:`services.planner.core.models.MapModel`).

A SOM for time series: each unit i has a weight w_i and contexts c_1,i .. c_K,i, a gamma filter of the past in the same space.

- The context of moment n comes from the last winner I: c_k(n) = beta c_k,I + (1 - beta) c_(k-1),I, with c_0,I = w_I, and c(0) = 0 at the
  first sample of each trajectory.
- The winner has the least d_i(n) = a_w |x(n) - w_i|^2 + sum over k of a_k |c_k(n) - c_k,i|^2, the a falling with k, their sum 1.
- Winner and neighbours on the lattice move: w_i towards x(n), each c_k,i towards c_k(n), by rate * exp(-d^2 / sigma^2), d being the
  distance on the lattice; rate and sigma fall from signal to signal.

The filter remembers about K / (1 - beta) samples, with resolution 1 - beta. K = 1 is the merge SOM (Strickert and Hammer 2005), K = 0 is
a SOM.

Source: Estévez and Hernández, "Gamma SOM for temporal sequence processing", WSOM 2009. Its text was not at hand, so what the formulas
leave open is our choice: everything is relative to the mean of the samples (so that c(0) = 0 lies in their middle), units begin on the
principal plane with all contexts at the weight (where the filter ends while the arm stands), and rate and sigma fall exponentially.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.planner.core.lattice import LatticeModel, checked_lattice, lattice_of, principal_plane
from services.planner.core.models import Progress, checked_samples, checked_starts
from services.planner.kernels import gamma_som as kernel
from services.planner.kernels.som import Lattice

__all__ = ["GammaSom", "GammaSomParameters"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]

CHUNK = 100  # trajectories between two reports of progress; our choice, about 4000 samples


@dataclass(frozen=True)
class GammaSomParameters:
    """Names of the paper; ``sigma`` in steps of the lattice, the default for 100 x 100 units (others: :meth:`of`).

    ``a_w`` is the share of the weight in a distance; the K contexts share the rest as K : K - 1 : ... : 1. Figures are measured on the
    50 000 samples of the UR3's map. Planning knows the weights alone, so context may not cost much of their fineness.
    """

    rows: int = 100  # paper
    columns: int = 100  # paper
    n_neighbours: int = 8  # 4 or 8; as for the SOM
    n_contexts: int = 2  # K; measured: 1 and 3 change the figures below by 2 % at most
    beta: float = 0.7  # our choice: a memory of 7 samples, a sixth of a trajectory; measured: 0.5 differs as little
    # measured: quantisation error 0.320 rad (0.316 without context), while the place 8 samples ago is known to 0.60 instead of 0.66 rad
    # (rms); with 0.5 the error is 0.358, and half of all samples have their two best units on sheets of the lattice that no edge joins
    a_w: float = 0.8
    epochs: int = 40  # measured: 84 s; half of them end at 0.338 rad
    rate_start: float = 0.3  # our choice
    rate_end: float = 0.02  # measured: 0.05 gains 0.014 rad of quantisation error, but its edges are a quarter longer
    sigma_start_steps: float = 18.0  # our choice: as wide as the SOM's radius of 13
    sigma_end_steps: float = 1.0  # measured: 0.7 gains 0.04 rad; the topographic error grows from 0.14 to 0.22

    def __post_init__(self) -> None:
        checked_lattice(self.rows, self.columns, self.n_neighbours)
        if self.n_contexts < 0 or self.epochs < 1:
            raise ValueError(f"n_contexts must be at least 0 and epochs at least 1, got {self.n_contexts} and {self.epochs}")
        if not 0.0 <= self.beta < 1.0:
            raise ValueError(f"beta must be at least 0 and below 1, got {self.beta}")
        if not 0.0 < self.a_w <= 1.0:
            raise ValueError(f"a_w must be above 0 and at most 1, got {self.a_w}")
        if not 1.0 >= self.rate_start >= self.rate_end > 0.0:
            raise ValueError(f"rates must fall from at most 1 and stay above zero, got {self.rate_start} to {self.rate_end}")
        if not self.sigma_start_steps >= self.sigma_end_steps > 0.0:
            raise ValueError(f"sigma must fall and stay above zero, got {self.sigma_start_steps} to {self.sigma_end_steps}")

    @staticmethod
    def of(rows: int, columns: int, n_neighbours: int = 8) -> GammaSomParameters:
        """The defaults for another lattice: sigma begins at the same share of its longer side."""
        sigma_start_steps = max(1.0, 0.18 * max(rows, columns))
        return GammaSomParameters(rows=rows, columns=columns, n_neighbours=n_neighbours, sigma_start_steps=sigma_start_steps)

    @property
    def distance_weights(self) -> F64:
        """(K + 1,) a_w, a_1 .. a_K; sum 1."""
        if self.n_contexts == 0:
            return np.ones(1)
        falling = np.arange(self.n_contexts, 0, -1, dtype=np.float64)
        return np.concatenate([[self.a_w], (1.0 - self.a_w) * falling / falling.sum()])


class GammaSom(LatticeModel):
    """A gamma-SOM on trajectories of joint configurations. The map it becomes, and its best match, know the weights alone."""

    def __init__(self, parameters: GammaSomParameters) -> None:
        super().__init__(parameters.rows, parameters.columns, parameters.n_neighbours)
        self.parameters = parameters
        self._lattice: Lattice | None = None
        self._mean_rad: F64 | None = None

    def fit(self, samples_rad: F64, trajectory_starts: I64, seed: int, progress: Progress | None = None) -> GammaSom:
        """Learn the trajectories of ``samples_rad`` (S, J), ``epochs`` times, each time in an order drawn by the seed.

        Raises:
            ValueError: samples not (S >= 2, J), not finite, or all the same; starts that do not rise from 0 to below S.
        """
        samples = checked_samples(samples_rad)
        starts = checked_starts(trajectory_starts, len(samples))
        p = self.parameters
        self._mean_rad = samples.mean(axis=0)
        centred = samples - self._mean_rad
        plane = principal_plane(centred, p.rows, p.columns)
        coefficient = np.repeat(p.distance_weights, samples.shape[1])
        self._lattice = lattice_of(np.tile(plane, (1, p.n_contexts + 1)), coefficient, p.rows, p.columns)
        self._train(self._lattice, centred, starts, np.random.default_rng(seed), progress)
        self._keep(self._lattice.vector[:, : samples.shape[1]] + self._mean_rad)
        return self

    def winners(self, samples_rad: F64, trajectory_starts: I64) -> I32:
        """(S,) the units that win along trajectories in their context; nothing moves.

        Raises:
            ValueError: not fitted yet, samples of another width, or starts that do not rise from 0 to below S.
        """
        if self._lattice is None or self._mean_rad is None:
            raise ValueError("the gamma-SOM is not fitted yet")
        samples = checked_samples(samples_rad)
        if samples.shape[1] != len(self._mean_rad):
            raise ValueError(f"samples have {samples.shape[1]} joints, the gamma-SOM has {len(self._mean_rad)}")
        starts = checked_starts(trajectory_starts, len(samples))
        winner = np.zeros(len(samples), dtype=np.int32)
        target = np.zeros(self._lattice.vector.shape[1])
        kernel.follow(self._lattice, samples - self._mean_rad, starts, _stops(starts, len(samples)), self.parameters.beta, winner, target)
        return winner

    def _train(self, lattice: Lattice, samples: F64, starts: I64, rng: np.random.Generator, progress: Progress | None) -> None:
        p = self.parameters
        stops = _stops(starts, len(samples))
        winner = np.zeros(len(samples), dtype=np.int32)
        target = np.zeros(lattice.vector.shape[1])
        n_shown, n_signals = 0, p.epochs * len(samples)
        for _ in range(p.epochs):
            order = rng.permutation(len(starts))
            for begin in range(0, len(order), CHUNK):
                chosen = order[begin : begin + CHUNK]
                first, stop = starts[chosen], stops[chosen]
                done = (n_shown + np.arange(np.sum(stop - first))) / (n_signals - 1)
                rate = p.rate_start * (p.rate_end / p.rate_start) ** done
                sigma_steps = p.sigma_start_steps * (p.sigma_end_steps / p.sigma_start_steps) ** done
                kernel.present(lattice, samples, first, stop, p.beta, rate, sigma_steps**2, winner, target)
                n_shown += len(done)
                if progress is not None:
                    progress(n_shown / n_signals)


def _stops(starts: I64, n_samples: int) -> I64:
    return np.append(starts[1:], n_samples)
