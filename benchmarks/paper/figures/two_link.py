"""The lookup table on an arm that fits on paper: two links in a plane. The worked example of ``docs/lookup-table.md``."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.paper.outcome import Outcome
from benchmarks.paper.study import Study

__all__ = ["Example", "TwoLink", "blocked_neurons", "build_table", "find_path", "lattice_neurons", "measure", "worked_example"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
SIDE = 24  # neurons along each joint; our choice, coarse enough to be seen one by one
N_CELLS = 20  # cells along each side of the square; our choice
OBSTACLE = (slice(15, 18), slice(15, 18))  # cells x, y that are occupied; our choice: only the forearm reaches them
START_RAD, GOAL_RAD = (0.2, 0.35), (2.1, 0.9)
INTRO = (
    "The idea of the table on an arm with two links of 1 m in a plane of 20 x 20 cells. Offline, forward kinematics says for each neuron "
    "(a joint configuration) which cells its links sweep; turned round, each cell has a row of the neurons that it blocks. Online, an "
    "obstacle is a handful of cells: their rows are read, no kinematics is done, and the search goes round what is blocked. "
    "`docs/lookup-table.md` walks through it; that page is a test."
)


@dataclass(frozen=True)
class TwoLink:
    """An arm of two links (metres) with its base in the middle of a square of ``n_cells`` x ``n_cells`` cells, just in reach."""

    links_m: tuple[float, float] = (1.0, 1.0)
    n_cells: int = N_CELLS
    samples: int = 60  # points along each link; closer together than half a cell

    @property
    def half_m(self) -> float:
        """Half of the square's side."""
        return sum(self.links_m)

    def points(self, q_rad: F64) -> F64:
        """(2 * samples, 2) points along both links at joint angles (2,)."""
        elbow = self.links_m[0] * np.array([np.cos(q_rad[0]), np.sin(q_rad[0])])
        angle = q_rad[0] + q_rad[1]
        tip = elbow + self.links_m[1] * np.array([np.cos(angle), np.sin(angle)])
        t = np.linspace(0.0, 1.0, self.samples)[:, None]
        return np.asarray(np.vstack([t * elbow, elbow + t * (tip - elbow)]))

    def cells(self, q_rad: F64) -> I64:
        """(C,) ascending flat cells (x * n_cells + y) that the arm sweeps at joint angles (2,)."""
        xy = np.floor((self.points(q_rad) + self.half_m) / (2.0 * self.half_m) * self.n_cells).astype(np.int64)
        x, y = np.clip(xy, 0, self.n_cells - 1).T
        return np.unique(x * self.n_cells + y)


def lattice_neurons(side: int = SIDE) -> F64:
    """(side * side, 2) neurons: shoulder 0 to 180 degrees (rows), elbow -150 to 150 degrees (columns)."""
    shoulder, elbow = np.linspace(0.0, np.pi, side), np.radians(np.linspace(-150.0, 150.0, side))
    return np.stack(np.meshgrid(shoulder, elbow, indexing="ij"), axis=-1).reshape(-1, 2)


def build_table(arm: TwoLink, neurons_rad: F64) -> list[I64]:
    """For each cell the neurons (ascending) that it blocks: forward kinematics once, turned round."""
    rows: list[list[int]] = [[] for _ in range(arm.n_cells**2)]
    for neuron, q in enumerate(neurons_rad):
        for cell in arm.cells(q):
            rows[int(cell)].append(neuron)
    return [np.array(row, dtype=np.int64) for row in rows]


def blocked_neurons(table: list[I64], occupied: I64, n_neurons: int) -> NDArray[np.bool_]:
    """(N,) which neurons the occupied cells block: table rows are read, nothing else."""
    count = np.zeros(n_neurons, dtype=np.int64)
    for cell in occupied:
        count[table[int(cell)]] += 1
    return np.asarray(count > 0)


def find_path(neurons_rad: F64, blocked: NDArray[np.bool_], start: int, goal: int, side: int = SIDE) -> list[int]:
    """Wavefront over the lattice's free neurons, each joined with four neighbours; empty if there is no way."""
    del neurons_rad
    parent = {start: start}
    queue = deque([start])
    while queue and goal not in parent:
        n = queue.popleft()
        row, column = divmod(n, side)
        for r, c in ((row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)):
            m = r * side + c
            if 0 <= r < side and 0 <= c < side and m not in parent and not blocked[m]:
                parent[m] = n
                queue.append(m)
    if goal not in parent:
        return []
    path = [goal]
    while path[-1] != start:
        path.append(parent[path[-1]])
    return path[::-1]


@dataclass(frozen=True, eq=False)
class Example:
    """Everything the picture shows."""

    arm: TwoLink
    neurons_rad: F64
    table: list[I64]
    occupied: I64
    blocked: NDArray[np.bool_]
    direct: list[int]
    path: list[int]


def worked_example() -> Example:
    """The page's example: the table, an obstacle of nine cells, the way before and after it came."""
    arm, neurons = TwoLink(), lattice_neurons()
    table = build_table(arm, neurons)
    inside = np.zeros((N_CELLS, N_CELLS), dtype=bool)
    inside[OBSTACLE] = True
    occupied = np.flatnonzero(inside)
    blocked = blocked_neurons(table, occupied, len(neurons))
    start, goal = (int(np.argmin(np.linalg.norm(neurons - np.array(q), axis=1))) for q in (START_RAD, GOAL_RAD))
    nothing = np.zeros(len(neurons), dtype=bool)
    return Example(
        arm,
        neurons,
        table,
        occupied,
        blocked,
        find_path(neurons, nothing, start, goal),
        find_path(neurons, blocked, start, goal),
    )


def measure(study: Study) -> Outcome:
    """The example's figures."""
    del study
    e = worked_example()
    row = {
        "neurons": len(e.neurons_rad),
        "cells": len(e.table),
        "entries": sum(len(r) for r in e.table),
        "occupied_cells": len(e.occupied),
        "blocked_neurons": int(e.blocked.sum()),
        "path_neurons_empty": len(e.direct),
        "path_neurons_obstacle": len(e.path),
    }
    return Outcome(INTRO, rows=[row], facts=row, data=e)
