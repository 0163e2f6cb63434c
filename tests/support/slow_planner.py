"""Slow and obvious twins of the planner's kernels."""

from __future__ import annotations

import heapq

import numpy as np

from common.robot.kernels import FAR, OUT_M, SLACK_M, TENTH_MM, BodyGrids
from services.planner.kernels.collision import Arm

__all__ = ["slow_close", "slow_counts", "slow_dijkstra", "slow_exposed", "slow_pose_cells", "slow_touches"]


def slow_touches(arm: Arm, b: int, frame: np.ndarray, centre: np.ndarray, half: float, safety: float) -> bool:
    """The rule in words: the cube is near if its ball surely is; if its ball may be, ask its eight octants, and theirs of those."""

    def distance(world: np.ndarray) -> float:
        return slow_close(arm.grids, b, frame[:3, :3].T @ (world - frame[:3, 3]))

    def touches(middle: np.ndarray, half: float, depth: int) -> bool:
        here = distance(middle)
        if here > safety + half * np.sqrt(3.0):
            return False
        if here <= safety + half or depth == 0:
            return True
        return any(touches(middle + half / 2 * sign, half / 2, depth - 1) for sign in signs)

    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    return touches(centre, half, 2)


def slow_close(grids: BodyGrids, b: int, point: np.ndarray) -> float:
    """The larger of two bounds: of the voxel that the point is in, and of the one ``OUT_M`` farther out, up the slope of the distances."""
    voxel = np.floor((point - grids.origin_m[b]) / grids.spacing_m).astype(int)
    if np.any(voxel < 0) or np.any(voxel >= grids.shape[b]):
        return FAR
    table = grids.distance[grids.offset[b] : grids.offset[b + 1]].reshape(grids.shape[b]).astype(float)

    def bound(voxel: np.ndarray) -> float:
        """A voxel's stored bound, less the half diagonal that it was lowered by, less the way to the voxel's centre."""
        centre = grids.origin_m[b] + (voxel + 0.5) * grids.spacing_m
        return float(table[tuple(voxel)] * TENTH_MM + grids.spacing_m * np.sqrt(3.0) / 2.0 - np.linalg.norm(point - centre))

    here = bound(voxel)
    if np.any(voxel == 0) or np.any(voxel == grids.shape[b] - 1):
        return here
    slope = np.array([table[tuple(voxel + step)] - table[tuple(voxel - step)] for step in np.eye(3, dtype=int)])
    if not slope.any():
        return here
    out = np.floor((point - grids.origin_m[b] + OUT_M * slope / np.linalg.norm(slope)) / grids.spacing_m).astype(int)
    if np.any(out < 0) or np.any(out >= grids.shape[b]):
        return here
    return max(here, bound(out) - SLACK_M)


def slow_pose_cells(arm: Arm, frames: np.ndarray, centres: np.ndarray, half: float, safety: float) -> np.ndarray:
    """Which of the cells (C,) with ``centres`` (C, 3) block a pose with world ``frames`` (J + 1, 4, 4)."""
    hit = np.zeros(len(centres), dtype=bool)
    for b in np.flatnonzero(arm.moving):
        frame = frames[arm.grids.body_joint[b]]
        middle = frame[:3, :3] @ arm.grids.bound_centre_m[b] + frame[:3, 3]
        near = np.linalg.norm(centres - middle, axis=1) <= arm.grids.bound_radius_m[b] + safety + half * np.sqrt(3.0) + 0.02
        for i in np.flatnonzero(near & ~hit):
            hit[i] = slow_touches(arm, int(b), frame, centres[i], half, safety)
    return hit


def slow_counts(rows: dict[int, list[int]], cells: set[int], n: int) -> np.ndarray:
    """Counts from nothing: each occupied cell adds one to each owner in its row."""
    count = np.zeros(n, dtype=np.int64)
    for cell in cells:
        for owner in rows.get(cell, []):
            count[owner] += 1
    return count


def slow_exposed(cells: np.ndarray, shape: tuple[int, int, int], never: set[int]) -> np.ndarray:
    """The cells (C,) of which one of the 26 around is empty, or ``never`` occupied, or outside."""
    full = {tuple(int(i) for i in np.unravel_index(cell, shape)) for cell in cells if cell not in never}

    def enclosed(cell: int) -> bool:
        x, y, z = (int(i) for i in np.unravel_index(cell, shape))
        return all((x + dx, y + dy, z + dz) in full for dx in (-1, 0, 1) for dy in (-1, 0, 1) for dz in (-1, 0, 1))

    return np.array([cell for cell in cells if not enclosed(cell)], dtype=np.int32)


def slow_dijkstra(n: int, edges: dict[tuple[int, int], float], starts: dict[int, float], goals: dict[int, float]) -> float:
    """Cost of the cheapest way from any start to any goal; infinite if there is none."""
    neighbours: dict[int, list[tuple[int, float]]] = {k: [] for k in range(n)}
    for (a, b), length in edges.items():
        neighbours[a].append((b, length))
        neighbours[b].append((a, length))
    best = dict.fromkeys(range(n), np.inf)
    heap = []
    for node, cost in starts.items():
        best[node] = min(best[node], cost)
        heapq.heappush(heap, (cost, node))
    while heap:
        cost, node = heapq.heappop(heap)
        if cost > best[node]:
            continue
        for other, length in neighbours[node]:
            if cost + length < best[other]:
                best[other] = cost + length
                heapq.heappush(heap, (cost + length, other))
    return min((best[node] + cost for node, cost in goals.items()), default=np.inf)
