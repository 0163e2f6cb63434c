"""A map under a payload: the neurons and edges that there are, with the cells of the box in their rows, and barred where it would hit.

Only the box is swept; what the bare arm sweeps is in the table already. So the table is ready in seconds, and equals one in which every
body is sampled by itself (``tests/unit/planner/test_burden.py``).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from common.robot.kernels import BodyGrids
from services.planner.core.growth import Ground
from services.planner.core.lookup import LookupTable, sweep, transpose
from services.planner.core.roadmap import Roadmap
from services.planner.core.world import no_cells
from services.planner.kernels.burden import bar
from services.planner.kernels.collision import Arm
from services.planner.kernels.merging import count_unions, fill_unions
from services.planner.kernels.static_layer import Solids

__all__ = ["burdened", "last_body_alone"]

I32 = NDArray[np.int32]
I64 = NDArray[np.int64]
N_THREADS = 2  # as for building


def last_body_alone(arm: Arm) -> Arm:
    """The arm as if its last body were all of it; without pairs."""
    grids, last = arm.grids, len(arm.moving) - 1
    parts = slice(grids.part_offset[last], grids.part_offset[last + 1])
    groups = slice(grids.group_offset[last], grids.group_offset[last + 1])
    spheres = slice(grids.group_sphere_offset[groups.start], grids.group_sphere_offset[groups.stop])
    alone = BodyGrids(
        body_joint=grids.body_joint[last:],
        spacing_m=grids.spacing_m,
        origin_m=grids.origin_m[last:],
        shape=grids.shape[last:],
        offset=grids.offset[last:] - grids.offset[last],
        distance=grids.distance[grids.offset[last] :],
        box_min_m=grids.box_min_m[last:],
        box_max_m=grids.box_max_m[last:],
        bound_centre_m=grids.bound_centre_m[last:],
        bound_radius_m=grids.bound_radius_m[last:],
        part_m=grids.part_m[parts],
        part_offset=grids.part_offset[last:] - parts.start,
        spheres_m=grids.spheres_m[spheres],
        group_m=grids.group_m[groups],
        group_sphere_offset=grids.group_sphere_offset[groups.start :] - spheres.start,
        group_offset=grids.group_offset[last:] - groups.start,
    )
    none = slice(0, 0)
    return arm._replace(
        grids=alone,
        moving=arm.moving[last:],
        lever_m=arm.lever_m[last:],
        pairs=arm.pairs[none],
        pair_margin_m=arm.pair_margin_m[none],
        pair_lever_m=arm.pair_lever_m[none],
    )


def burdened(roadmap: Roadmap, ground: Ground, solids: Solids, *, n_threads: int = N_THREADS) -> Roadmap:
    """``roadmap`` of the bare arm for the arm that holds a box; neurons and edges keep their numbers.

    Args:
        roadmap: of the bare arm; left as it is.
        ground: with the arm that holds the box as its last body.
        solids: the static layer.
        n_threads: that sweep.
    """
    table, grid = roadmap.table, ground.grid
    box = last_body_alone(ground.arm)
    swept = sweep(box, grid, roadmap.neurons_rad, roadmap.edges, safety_m=ground.safety_m, step_m=ground.step_m, n_threads=n_threads)
    node_rows = transpose(swept.node_offset, swept.node_cell, grid.n_cells, table.unavoidable)
    edge_rows = transpose(swept.edge_offset, swept.edge_cell, grid.n_cells, table.unavoidable)
    counts = _union_counts(table.node_offset, table.node_owner, *node_rows)
    full = counts == roadmap.n_neurons
    nodes = _union(table.node_offset, table.node_owner, *node_rows, np.where(full, 0, counts))
    edge_counts = _union_counts(table.edge_offset, table.edge_owner, *edge_rows)
    edges = _union(table.edge_offset, table.edge_owner, *edge_rows, np.where(full, 0, edge_counts))
    unavoidable = np.union1d(table.unavoidable, np.flatnonzero(full)).astype(np.int32) if roadmap.n_neurons else table.unavoidable
    barred = _barred(roadmap, ground, solids)
    return replace(roadmap, table=LookupTable(*nodes, *edges, unavoidable, *barred))


def _union_counts(offset_a: I64, owner_a: NDArray[Any], offset_b: I64, owner_b: NDArray[Any]) -> I64:
    counts = np.empty(len(offset_a) - 1, dtype=np.int64)
    count_unions(offset_a, owner_a, offset_b, owner_b, counts)
    return counts


def _union(offset_a: I64, owner_a: NDArray[Any], offset_b: I64, owner_b: NDArray[Any], counts: I64) -> tuple[I64, NDArray[Any]]:
    offset = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    owner = np.empty(offset[-1], dtype=owner_a.dtype)
    fill_unions(offset_a, owner_a, offset_b, owner_b, offset, owner)
    return offset, owner


def _barred(roadmap: Roadmap, ground: Ground, solids: Solids) -> tuple[I32, I32]:
    """Neurons and edges in which the box meets the static layer or the arm."""
    arm, last = ground.arm, len(ground.arm.moving) - 1
    moving = np.zeros_like(arm.moving)
    moving[last] = 1
    mine = np.flatnonzero((arm.pairs == last).any(axis=1))
    pairs: dict[str, Any] = {"pairs": arm.pairs[mine], "pair_margin_m": arm.pair_margin_m[mine], "pair_lever_m": arm.pair_lever_m[mine]}
    nodes, edges = np.zeros(roadmap.n_neurons, dtype=np.uint8), np.zeros(roadmap.n_edges, dtype=np.uint8)
    nothing = no_cells(ground.grid)
    margins = (ground.safety_m, ground.step_m)
    bar(arm._replace(moving=moving, **pairs), solids, nothing, *margins, roadmap.neurons_rad, roadmap.edges, nodes, edges)
    return np.flatnonzero(nodes).astype(np.int32), np.flatnonzero(edges).astype(np.int32)
