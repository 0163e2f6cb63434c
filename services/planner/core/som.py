"""Kohonen's self-organising map as an estimator (:class:`services.planner.core.models.MapModel`), trained as the SOM Toolbox does.

Two phases, rough and fine, of two ways of training:

- batch: each epoch finds the winner of every sample, then every unit becomes the mean of all samples, a sample whose winner lies at
  lattice distance d counting h(d) = exp(-d^2 / (2 r^2));
- sequential: each signal x, drawn at random, moves every unit by rate * h(d) * (x - w).

The radius r falls linearly within each phase. The rate falls inversely with time, rate(t) = a / (t + b), from its first value to a
hundredth of it, in each phase.

Sources: Kohonen, Self-Organizing Maps (1995); SOM Toolbox 2.0 (som_train_struct, som_batchtrain, som_seqtrain, som_lininit).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from services.planner.core.lattice import LatticeModel, checked_lattice, lattice_of, principal_plane
from services.planner.core.models import Progress, checked_samples
from services.planner.kernels import som as kernel

__all__ = ["SelfOrganisingMap", "SomParameters"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]
Training = Literal["batch", "sequential"]

CHUNK = 20_000  # signals between two reports of progress; our choice
RATE_FALL = 100.0  # first rate / last rate of a phase; SOM Toolbox


@dataclass(frozen=True)
class SomParameters:
    """Radii in steps of the lattice. The defaults are those of the SOM Toolbox for 100 x 100 units and 50 000 samples; see :meth:`of`."""

    rows: int = 100  # paper
    columns: int = 100  # paper
    n_neighbours: int = 8  # 4 or 8; measured: a topographic error of 0.06 against 0.15, and ways along diagonals are shorter
    training: Training = "batch"  # SOM Toolbox
    radius_start_steps: float = 13.0  # SOM Toolbox
    radius_middle_steps: float = 3.25  # SOM Toolbox
    radius_end_steps: float = 1.0  # SOM Toolbox
    epochs_rough: int = 2  # SOM Toolbox; in sequential training only their ratio counts
    epochs_fine: int = 8  # SOM Toolbox
    rate_rough: float = 0.5  # SOM Toolbox; sequential only
    rate_fine: float = 0.05  # SOM Toolbox; sequential only
    signals_per_unit: int = 500  # Kohonen 1995: at least; sequential only

    def __post_init__(self) -> None:
        checked_lattice(self.rows, self.columns, self.n_neighbours)
        if self.training not in ("batch", "sequential"):
            raise ValueError(f"training must be batch or sequential, got {self.training!r}")
        if not self.radius_start_steps >= self.radius_middle_steps >= self.radius_end_steps > 0.0:
            radii = (self.radius_start_steps, self.radius_middle_steps, self.radius_end_steps)
            raise ValueError(f"radii must fall and stay above zero, got {radii}")
        if min(self.epochs_rough, self.epochs_fine, self.signals_per_unit) < 1:
            counts = (self.epochs_rough, self.epochs_fine, self.signals_per_unit)
            raise ValueError(f"epochs_rough, epochs_fine and signals_per_unit must be at least 1, got {counts}")
        if not (0.0 < self.rate_rough <= 1.0 and 0.0 < self.rate_fine <= 1.0):
            raise ValueError(f"rates must be above 0 and at most 1, got {self.rate_rough} and {self.rate_fine}")

    @staticmethod
    def of(rows: int, columns: int, n_samples: int, training: Training = "batch", n_neighbours: int = 8) -> SomParameters:
        """The SOM Toolbox's parameters for a lattice and a number of samples (som_train_struct after som_lininit)."""
        start = float(max(1, math.ceil(max(rows, columns) / 8)))
        return SomParameters(
            rows=rows,
            columns=columns,
            n_neighbours=n_neighbours,
            training=training,
            radius_start_steps=start,
            radius_middle_steps=max(1.0, start / 4.0),
            epochs_rough=math.ceil(10 * rows * columns / n_samples),
            epochs_fine=math.ceil(40 * rows * columns / n_samples),
        )


class SelfOrganisingMap(LatticeModel):
    """A SOM on joint configurations. Batch training draws nothing at random: every seed gives the same map."""

    def __init__(self, parameters: SomParameters) -> None:
        super().__init__(parameters.rows, parameters.columns, parameters.n_neighbours)
        self.parameters = parameters

    def fit(self, samples_rad: F64, trajectory_starts: I64, seed: int, progress: Progress | None = None) -> SelfOrganisingMap:
        """Begin on the principal plane of ``samples_rad`` (S, J), then train; starts are ignored.

        Raises:
            ValueError: samples not (S >= 2, J) or not finite, or all the same.
        """
        del trajectory_starts
        samples = checked_samples(samples_rad)
        lattice = lattice_of(principal_plane(samples, self.rows, self.columns), np.ones(samples.shape[1]), self.rows, self.columns)
        if self.parameters.training == "batch":
            self._train_in_batches(lattice, samples, progress)
        else:
            self._train_in_sequence(lattice, samples, np.random.default_rng(seed), progress)
        self._keep(lattice.vector)
        return self

    def _train_in_batches(self, lattice: kernel.Lattice, samples: F64, progress: Progress | None) -> None:
        p = self.parameters
        rough = np.linspace(p.radius_start_steps, p.radius_middle_steps, p.epochs_rough)
        fine = np.linspace(p.radius_middle_steps, p.radius_end_steps, p.epochs_fine)
        winner = np.zeros(len(samples), dtype=np.int32)
        total = np.zeros((len(lattice.vector), samples.shape[1] + 1))
        scratch = np.zeros_like(total)
        for epoch, radius_steps in enumerate(np.concatenate([rough, fine])):
            kernel.assign(lattice, samples, winner, total)
            kernel.smooth(lattice, total, scratch, 2.0 * radius_steps**2)
            if progress is not None:
                progress((epoch + 1) / (p.epochs_rough + p.epochs_fine))

    def _train_in_sequence(self, lattice: kernel.Lattice, samples: F64, rng: np.random.Generator, progress: Progress | None) -> None:
        p = self.parameters
        n_signals = p.signals_per_unit * p.rows * p.columns
        n_rough = n_signals * p.epochs_rough // (p.epochs_rough + p.epochs_fine)
        winner = np.zeros(len(samples), dtype=np.int32)
        phases = [
            (0, n_rough, p.rate_rough, p.radius_start_steps, p.radius_middle_steps),
            (n_rough, n_signals, p.rate_fine, p.radius_middle_steps, p.radius_end_steps),
        ]
        for first, stop, rate_start, radius_first_steps, radius_last_steps in phases:
            last = max(stop - first - 1, 1)
            for begin in range(first, stop, CHUNK):
                step = np.arange(begin, min(begin + CHUNK, stop)) - first
                rate = rate_start / (1.0 + (RATE_FALL - 1.0) * step / last)
                radius_steps = radius_first_steps + (radius_last_steps - radius_first_steps) * step / last
                kernel.present(lattice, samples, rng.integers(len(samples), size=len(step)), rate, 2.0 * radius_steps**2, winner)
                if progress is not None:
                    progress((begin + len(step)) / n_signals)
