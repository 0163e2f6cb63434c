"""What a box in the gripper adds to a map: its own rows, and what it bars. Joined with the bare arm's table they are the table of both.

Only the box is swept; what the bare arm sweeps is in its table already. So a box is ready in seconds, and the table equals one in which
every body is sampled by itself (``tests/unit/planner/test_burden.py``). Where the map grows, the box's rows grow by the arm's own code.
"""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from common.robot.kernels import BodyGrids
from services.planner.core.growth import Addition, Ground, grown
from services.planner.core.layer_table import NO_LAYERS, LayerTable
from services.planner.core.layers import build_layers
from services.planner.core.lookup import N_THREADS, LookupTable, build_table
from services.planner.core.roadmap import Roadmap
from services.planner.core.world import no_cells
from services.planner.kernels.burden import bar
from services.planner.kernels.collision import Arm
from services.planner.kernels.lookup import PAGE
from services.planner.kernels.merging import count_unions, fill_unions
from services.planner.kernels.static_layer import Solids

__all__ = ["Burden", "BurdenGround", "last_body_alone"]

I32 = NDArray[np.int32]
I64 = NDArray[np.int64]
U16 = NDArray[np.uint16]
Rows = tuple[I64, U16]  # offsets and owners, in pages (core/rows.py)


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
    unpaired = _with_pairs(arm, np.empty(0, dtype=np.int64))
    return unpaired._replace(grids=alone, moving=arm.moving[last:], lever_m=arm.lever_m[last:])


def _with_pairs(arm: Arm, which: I64) -> Arm:
    """The arm with only some of its pairs of bodies."""
    tables = arm.pair_tables
    return arm._replace(
        pairs=arm.pairs[which],
        pair_tables=tables._replace(table=tables.table[which], first_joint=tables.first_joint[which]),
        pair_margin_m=arm.pair_margin_m[which],
        pair_lever_m=arm.pair_lever_m[which],
    )


@dataclass(frozen=True, eq=False)
class BurdenGround:
    """What a box adds depends on this besides the map.

    Attributes:
        alone: the box as if it were all of the arm.
        barring: the whole arm, of which only the box and what it can touch are looked at.
        solids: the static layer.
    """

    alone: Ground
    barring: Arm
    solids: Solids

    @staticmethod
    def of(ground: Ground, solids: Solids) -> BurdenGround:
        """From that of the arm that holds the box as its last body."""
        arm, last = ground.arm, len(ground.arm.moving) - 1
        box = last_body_alone(arm)
        layers = None if ground.layers is None else replace(ground.layers, arm=box)
        moving = np.zeros_like(arm.moving)
        moving[last] = 1
        barring = _with_pairs(arm, np.flatnonzero((arm.pairs == last).any(axis=1)))._replace(moving=moving)
        return BurdenGround(replace(ground, arm=box, layers=layers), barring, solids)


@dataclass(frozen=True, eq=False)
class Burden:
    """A box on a map. ``roadmap``: the map's neurons and edges with the table of the box alone, and with what it bars."""

    ground: BurdenGround
    roadmap: Roadmap

    @staticmethod
    def of(roadmap: Roadmap, ground: BurdenGround) -> Burden:
        """What the box adds to ``roadmap``, whose own table counts for nothing."""
        alone = ground.alone
        q, edges = roadmap.neurons_rad, roadmap.edges
        with ThreadPoolExecutor(1) as pool:  # the others are in threads, too
            barred = pool.submit(_barred, roadmap, ground)
            table = build_table(alone.arm, alone.grid, q, edges, safety_m=alone.safety_m, step_m=alone.step_m)
            if alone.layers is not None and roadmap.table.layers.n_bands:
                table = replace(table, layers=build_layers(alone.layers, q, edges))
        return Burden(ground, _with_barred(roadmap, table, barred.result()))

    def on(self, larger: Roadmap) -> Burden:
        """The same on a map that has grown out of this one; on any other it is made anew."""
        old, n, m = self.roadmap, self.roadmap.n_neurons, self.roadmap.n_edges
        if not (np.array_equal(larger.neurons_rad[:n], old.neurons_rad) and np.array_equal(larger.edges[:m], old.edges)):
            return Burden.of(larger, self.ground)
        addition = Addition(larger.neurons_rad[n:], larger.edges[m:])
        if addition.is_empty:
            return self
        new = grown(old, addition, self.ground.alone)
        return Burden(self.ground, _with_barred(new, new.table, _barred(new, self.ground, old)))

    def joined(self, bare: Roadmap) -> Roadmap:
        """``bare``, the map of the bare arm, for the arm that holds the box; neurons and edges keep their numbers."""
        with ThreadPoolExecutor(N_THREADS) as pool:
            layers = pool.submit(_joined_layers, bare, self.roadmap)
            return replace(bare, table=_joined_cells(bare, self.roadmap, layers))


def _joined_cells(bare: Roadmap, box: Roadmap, layers: Future[LayerTable]) -> LookupTable:
    """The table of both; a cell that arm and box sweep together, whatever the neuron, cannot be avoided either."""
    a, b, n = bare.table, box.table, bare.n_neurons
    full = np.zeros(a.node_offset.shape[1] - 1, dtype=bool)
    full[a.unavoidable] = full[b.unavoidable] = True
    nodes = _Union((a.node_offset, a.node_owner), (b.node_offset, b.node_owner), 1)
    full |= (nodes.counts.sum(axis=0) == n) & (n > 0)
    edges = _Union((a.edge_offset, a.edge_owner), (b.edge_offset, b.edge_owner), 1)
    rows = (*nodes.rows(full), *edges.rows(full))
    return LookupTable(*rows, np.flatnonzero(full).astype(np.int32), layers.result(), b.barred_nodes, b.barred_edges)


def _joined_layers(bare: Roadmap, box: Roadmap) -> LayerTable:
    """Each owner in the lower one of its bands of a block."""
    a, b = bare.table.layers, box.table.layers
    if a.n_bands == 0:
        return NO_LAYERS
    nodes = _Union((a.node_offset, a.node_owner), (b.node_offset, b.node_owner), a.n_bands)
    edges = _Union((a.edge_offset, a.edge_owner), (b.edge_offset, b.edge_owner), a.n_bands)
    return LayerTable(a.beyond_m, a.cells_shape, a.block_cells, *nodes.rows(), *edges.rows())


class _Union:
    """Rows of two tables of the same pages as one; see the kernels."""

    def __init__(self, a: Rows, b: Rows, n_bands: int) -> None:
        self._tables, self._n_bands = (a, b), n_bands
        self.counts = np.empty((len(a[0]), a[0].shape[1] - 1), dtype=np.int64)  # (pages, rows)
        for page, counts in enumerate(self.counts):
            count_unions(*self._page(page), n_bands, _nobody(), counts)

    def rows(self, left_out: NDArray[np.bool_] | None = None) -> Rows:
        """Offsets and owners; rows that are ``left_out`` are empty."""
        counts = self.counts if left_out is None else np.where(left_out, 0, self.counts)
        ends = np.cumsum(counts.ravel()).reshape(counts.shape)
        offset = np.concatenate([ends[:, :1] - counts[:, :1], ends], axis=1).astype(np.int64)
        owner = np.empty(offset[-1, -1], dtype=np.uint16)
        for page, rows in enumerate(offset):
            fill_unions(*self._page(page), self._n_bands, _nobody(), rows, owner)
        return offset, owner

    def _page(self, page: int) -> tuple[I64, U16, I64, U16]:
        (offset_a, owner_a), (offset_b, owner_b) = self._tables
        return offset_a[page], owner_a, offset_b[page], owner_b


def _nobody() -> I64:
    return np.full(PAGE, -1, dtype=np.int64)


def _barred(roadmap: Roadmap, ground: BurdenGround, before: Roadmap | None = None) -> tuple[I32, I32]:
    """Neurons and edges in which the box meets the static layer or the arm; of a map that has grown, what was known ``before`` is kept."""
    alone = ground.alone
    nodes, edges = np.zeros(roadmap.n_neurons, dtype=np.uint8), np.zeros(roadmap.n_edges, dtype=np.uint8)
    n, m = (0, 0) if before is None else (before.n_neurons, before.n_edges)
    if before is not None:
        nodes[before.table.barred_nodes] = 1
        edges[before.table.barred_edges] = 1
    checks = (ground.barring, ground.solids, no_cells(alone.grid), alone.safety_m, alone.step_m)
    bar(*checks, roadmap.neurons_rad, roadmap.edges, n, m, nodes, edges)
    return np.flatnonzero(nodes).astype(np.int32), np.flatnonzero(edges).astype(np.int32)


def _with_barred(roadmap: Roadmap, table: LookupTable, barred: tuple[I32, I32]) -> Roadmap:
    return replace(roadmap, table=replace(table, barred_nodes=barred[0], barred_edges=barred[1]))
