"""What the three models of the map have in common: the contract, and the checks of what they learn from."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from services.planner.core.cognitive_map import CognitiveMap

__all__ = ["MapModel", "Progress", "checked_samples", "checked_starts"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Progress = Callable[[float], None]  # share done, 0..1


class MapModel(Protocol):
    """An estimator of a cognitive map: growing neural gas, SOM, gamma-SOM.

    Same samples, trajectory starts, parameters and seed give the same map byte for byte.
    """

    def fit(self, samples_rad: F64, trajectory_starts: I64, seed: int, progress: Progress | None = None) -> Self:
        """Learn from nothing.

        Args:
            samples_rad: (S, J) joint configurations, one trajectory after the other.
            trajectory_starts: (T,) int64, the row of each trajectory's first sample; matters to models with a memory only.
            seed: of everything drawn at random.
            progress: called with the share that is done, 0 to 1.

        Raises:
            ValueError: samples (or, for models with a memory, starts) that nothing can be learned from; says what is wrong.
        """
        ...

    def partial_fit(self, samples_rad: F64, seed: int, n_signals: int | None = None) -> Self:
        """Learn further samples (S, J) after :meth:`fit`, ``n_signals`` of them drawn by the seed (default: as many as samples).

        Raises:
            ValueError: not fitted yet, samples of another width, or a model that cannot be extended.
        """
        ...

    def to_map(self) -> CognitiveMap:
        """Neurons and edges.

        Raises:
            ValueError: not fitted yet.
        """
        ...

    def best_match(self, q_rad: F64) -> int:
        """Index (as in :meth:`to_map`) of the neuron nearest to ``q_rad`` (J,), by weights alone; ties go to the lower index.

        Raises:
            ValueError: not fitted yet.
        """
        ...


def checked_samples(samples_rad: F64) -> F64:
    """The samples as contiguous float64 (S, J).

    Raises:
        ValueError: not (S >= 2, J >= 1), or not finite.
    """
    samples = np.ascontiguousarray(samples_rad, dtype=np.float64)
    if samples.ndim != 2 or len(samples) < 2 or samples.shape[1] < 1 or not np.all(np.isfinite(samples)):
        raise ValueError(f"samples must be finite and of shape (S >= 2, J), got shape {samples.shape}")
    return samples


def checked_starts(trajectory_starts: I64, n_samples: int) -> I64:
    """The starts as int64 (T,).

    Raises:
        ValueError: not whole numbers that begin with 0 and rise strictly to below ``n_samples``.
    """
    starts = np.asarray(trajectory_starts)
    if starts.ndim != 1 or len(starts) == 0 or not np.issubdtype(starts.dtype, np.integer):
        raise ValueError(f"trajectory starts must be (T >= 1,) integers, got {starts.dtype} of shape {starts.shape}")
    if starts[0] != 0 or np.any(np.diff(starts) <= 0) or starts[-1] >= n_samples:
        raise ValueError(f"trajectory starts must rise from 0 to below {n_samples}, got {starts[0]} to {starts[-1]}")
    return starts.astype(np.int64)
