"""Samples of joint configurations with a shape that is known."""

from __future__ import annotations

import numpy as np

__all__ = ["ring", "square"]


def ring(n: int, n_joints: int = 6, seed: int = 1) -> np.ndarray:
    """Samples along a bent closed curve with a little noise."""
    rng = np.random.default_rng(seed)
    t = rng.uniform(0, 2 * np.pi, n)
    waves = [np.cos(t), np.sin(t), 0.5 * np.sin(2 * t), 0.3 * np.cos(3 * t), 0.2 * np.sin(t), 0.1 * np.cos(2 * t)]
    return np.stack(waves[:n_joints], axis=1) + rng.normal(scale=0.02, size=(n, n_joints))


def square(n: int, seed: int = 2) -> np.ndarray:
    """Samples of a unit square, bent into four joints: what a lattice can unfold on without a fold."""
    u, v = np.random.default_rng(seed).uniform(size=(2, n))
    return np.stack([u, v, 0.3 * u * u, 0.2 * u * v], axis=1)
