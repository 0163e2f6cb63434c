"""RRTConnect (Kuffner and LaValle 2000) and path shortcuts in joint space, bounded by counts, never by time.

Every motion goes through :func:`segment_is_free`, and that through the one collision check.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from common.kernel import copy_row, kernel, leaf
from services.planner.kernels.cells import Cells
from services.planner.kernels.collision import Arm, pose_is_free
from services.planner.kernels.static_layer import Solids
from services.planner.kernels.xoshiro import uniform

__all__ = ["Trees", "World", "grow_until_joined", "segment_is_free", "shortcut"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
U64 = NDArray[np.uint64]

ADVANCED, REACHED, TRAPPED = 0, 1, 2


class World(NamedTuple):
    """What a motion is checked against, with the scratch of one check."""

    arm: Arm
    solids: Solids
    cells: Cells
    safety_m: float  # kept from cells
    rotation: F64  # (J + 1, 3, 3) scratch
    translation: F64  # (J + 1, 3) scratch
    q_rad: F64  # (J,) scratch


class Trees(NamedTuple):
    """Two trees, from the start (0) and from the goal (1), with room for M nodes each."""

    q_rad: F64  # (2, M, J)
    parent: I32  # (2, M)
    n_nodes: I32  # (2,)


@leaf
def _distance(a: F64, b: F64) -> float:
    total = 0.0
    for j in range(len(a)):
        total += (a[j] - b[j]) ** 2
    return math.sqrt(total)


@leaf
def segment_is_free(world: World, q_a: F64, q_b: F64, step_rad: float) -> bool:
    """Whether the straight joint motion from ``q_a`` to ``q_b`` (J,) is free at poses at most ``step_rad`` apart.

    ``q_a`` itself is taken to be free; ``q_b`` is looked at first, then the middle, the quarters and so on: what collides shows early.
    """
    n = math.ceil(_distance(q_a, q_b) / step_rad)
    q = world.q_rad
    if not pose_is_free(world.arm, world.solids, world.cells, world.safety_m, q_b, world.rotation, world.translation):
        return False
    stride = 1
    while stride < n:
        stride *= 2
    while stride >= 2:  # odd multiples of half a stride are new at this level
        for i in range(stride // 2, n, stride):
            for j in range(len(q)):
                q[j] = q_a[j] + (q_b[j] - q_a[j]) * (i / n)
            if not pose_is_free(world.arm, world.solids, world.cells, world.safety_m, q, world.rotation, world.translation):
                return False
        stride //= 2
    return True


@leaf
def _nearest(trees: Trees, side: int, q: F64) -> int:
    best, best_distance = 0, np.inf
    for i in range(trees.n_nodes[side]):
        total = 0.0
        for j in range(len(q)):
            total += (trees.q_rad[side, i, j] - q[j]) ** 2
        if total < best_distance:
            best, best_distance = i, total
    return best


@leaf
def _extend(world: World, trees: Trees, side: int, origin: int, target: F64, range_rad: float, step_rad: float) -> int:
    """One step of at most ``range_rad`` from node ``origin`` to ``target``; the new node is the last of its tree."""
    n = trees.n_nodes[side]
    if n == trees.q_rad.shape[1]:
        return TRAPPED
    start, new = trees.q_rad[side, origin], trees.q_rad[side, n]
    far = _distance(start, target)
    share = min(1.0, range_rad / far) if far > 0.0 else 1.0
    for j in range(len(target)):
        new[j] = start[j] + share * (target[j] - start[j]) if share < 1.0 else target[j]
    if not segment_is_free(world, start, new, step_rad):
        return TRAPPED
    trees.parent[side, n] = origin
    trees.n_nodes[side] = n + 1
    return REACHED if share == 1.0 else ADVANCED


@leaf
def _joined_path(trees: Trees, path: F64) -> int:
    """The last nodes of both trees coincide: the way from root 0 to root 1 into ``path``; its length, 0 if it is too long."""
    n_start, n_goal = 0, 0
    i = int(trees.n_nodes[0] - 1)
    while i >= 0:
        n_start += 1
        i = int(trees.parent[0, i])
    i = int(trees.parent[1, trees.n_nodes[1] - 1])
    while i >= 0:
        n_goal += 1
        i = int(trees.parent[1, i])
    if n_start + n_goal > len(path):
        return 0
    i, k = int(trees.n_nodes[0] - 1), n_start - 1
    while i >= 0:
        copy_row(trees.q_rad[0, i], path[k])
        i, k = int(trees.parent[0, i]), k - 1
    i, k = int(trees.parent[1, trees.n_nodes[1] - 1]), n_start
    while i >= 0:
        copy_row(trees.q_rad[1, i], path[k])
        i, k = int(trees.parent[1, i]), k + 1
    return n_start + n_goal


@kernel
def grow_until_joined(
    world: World,
    trees: Trees,
    q_start: F64,
    q_goal: F64,
    q_min: F64,
    q_max: F64,
    range_rad: float,
    step_rad: float,
    max_iterations: int,
    rng: U64,
    path: F64,
) -> int:
    """A free path from ``q_start`` to ``q_goal`` (J,), both taken to be free, into ``path`` (P, J); its number of points, 0 if none.

    ``trees`` is scratch, ``rng`` (4,) is advanced. At most ``max_iterations`` samples of the box ``q_min`` .. ``q_max``.
    """
    for side in range(2):
        trees.n_nodes[side] = 1
        trees.parent[side, 0] = -1
    trees.q_rad[0, 0], trees.q_rad[1, 0] = q_start, q_goal
    if segment_is_free(world, q_start, q_goal, step_rad):
        path[0], path[1] = q_start, q_goal
        return 2
    q_random = np.empty(len(q_start))
    side = 0
    for _ in range(max_iterations):
        for j in range(len(q_random)):
            q_random[j] = q_min[j] + uniform(rng) * (q_max[j] - q_min[j])
        if _extend(world, trees, side, _nearest(trees, side, q_random), q_random, range_rad, step_rad) != TRAPPED:
            q_new = trees.q_rad[side, trees.n_nodes[side] - 1]
            other = 1 - side
            origin = _nearest(trees, other, q_new)
            status = ADVANCED
            while status == ADVANCED:
                status = _extend(world, trees, other, origin, q_new, range_rad, step_rad)
                origin = int(trees.n_nodes[other] - 1)
            if status == REACHED:
                return int(_joined_path(trees, path))
        side = 1 - side
    return 0


@leaf
def _point_at(path: F64, n_points: int, along: float, q: F64) -> int:
    """Fill ``q`` with the point at ``along`` rad of the path's length; the index of the segment it lies on."""
    for i in range(n_points - 1):
        length = _distance(path[i], path[i + 1])
        if along <= length or i == n_points - 2:
            share = min(along / length, 1.0) if length > 0.0 else 0.0
            for j in range(len(q)):
                q[j] = path[i, j] + share * (path[i + 1, j] - path[i, j])
            return i
        along -= length
    return n_points - 2


@kernel
def shortcut(world: World, path: F64, n_points: int, n_attempts: int, step_rad: float, rng: U64) -> int:
    """Replace stretches between random points of ``path[:n_points]`` by straight motions where these are free; the new number of points.

    Geraerts and Overmars, "Creating high-quality paths for motion planning" (2007). ``path`` (P, J) must have room for one point more.
    """
    q_a, q_b = np.empty(path.shape[1]), np.empty(path.shape[1])
    for _ in range(n_attempts):
        if n_points <= 2:
            break
        length = 0.0
        for i in range(n_points - 1):
            length += _distance(path[i], path[i + 1])
        first, second = uniform(rng) * length, uniform(rng) * length
        i = _point_at(path, n_points, min(first, second), q_a)
        k = _point_at(path, n_points, max(first, second), q_b)
        if i == k or not segment_is_free(world, q_a, q_b, step_rad):
            continue
        # points i+1..k go, q_a and q_b come
        shift = 2 - (k - i)
        if n_points + shift > len(path):
            continue
        if shift > 0:
            path[n_points] = path[n_points - 1]
            for p in range(n_points - 1, k + 1, -1):
                path[p] = path[p - 1]
        elif shift < 0:
            for p in range(k + 1, n_points):
                path[p + shift] = path[p]
        path[i + 1], path[i + 2] = q_a, q_b
        n_points += shift
    return n_points
