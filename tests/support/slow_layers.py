"""Slow and obvious twins of the layers of clearance."""

from __future__ import annotations

import numpy as np

from services.planner.core.layer_table import LayerTable
from services.planner.kernels.collision import Arm
from services.planner.kernels.reach import REACH_SPACING_M, Reach

__all__ = ["slow_far", "slow_nearest", "slow_pose_bands"]


def slow_far(reach: Reach, b: int, point: np.ndarray) -> float:
    """What body ``b``'s grid stores where a point of its joint frame lies."""
    ijk = np.floor((point - reach.origin_m[b]) / REACH_SPACING_M).astype(int)
    if np.any(ijk < 0) or np.any(ijk >= reach.shape[b]):
        return reach.far_m
    grid = reach.distance[reach.offset[b] : reach.offset[b + 1]].reshape(reach.shape[b])
    return float(grid[tuple(ijk)]) * 1e-4


def slow_pose_bands(arm: Arm, reach: Reach, frames: np.ndarray, centres: np.ndarray, half: float, within: np.ndarray) -> np.ndarray:
    """(n_blocks,) band of each block with ``centres`` (n_blocks, 3): how many of the layers ``within`` (L,) do not hold it.

    A block is in a layer if its ball surely is; if its ball may be, ask its eight octants.
    """
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    bands = np.full(len(centres), len(within))
    for i, centre in enumerate(centres):
        held = np.zeros(len(within), dtype=bool)
        for b in np.flatnonzero(arm.moving):
            frame = frames[arm.grids.body_joint[b]]

            def distance(world: np.ndarray, b: int = int(b), frame: np.ndarray = frame) -> float:
                return slow_far(reach, b, frame[:3, :3].T @ (world - frame[:3, 3]))

            here = distance(centre)
            if here > within[-1] + half * np.sqrt(3.0):
                continue
            octants = min(distance(centre + half / 2 * sign) for sign in signs)
            may_be = here <= within + half * np.sqrt(3.0)
            held |= (here <= within + half) | (may_be & (octants <= within + half / 2 * np.sqrt(3.0)))
        bands[i] = np.count_nonzero(~held)
        assert np.all(np.diff(held.astype(int)) >= 0), "a wider layer holds what a narrower one holds"
    return bands


def slow_nearest(table: LayerTable, blocks: set[int], n_neurons: int, n_edges: int) -> tuple[np.ndarray, np.ndarray]:
    """(N,) and (M,) the lowest band of each neuron and edge in which any of the occupied ``blocks`` is; the number of bands if in none."""
    node, edge = np.full(n_neurons, table.n_bands), np.full(n_edges, table.n_bands)
    for block in blocks:
        for band in range(table.n_bands):
            for nearest, owners in ((node, table.neurons_of(block, band)), (edge, table.edges_of(block, band))):
                nearest[owners] = np.minimum(nearest[owners], band)
    return node, edge
