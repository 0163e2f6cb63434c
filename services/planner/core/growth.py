"""A map that grows: neurons and edges are added behind those that are there, and their rows go into the lookup table.

Nothing that is there moves or changes its number, so a motion under way keeps its neurons, and what was built stays told from what was
learned by its number alone. The grown table equals one that is built from
nothing on the same neurons and edges.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.geometry.grid import Grid
from services.planner.core.cognitive_map import CognitiveMap
from services.planner.core.layer_table import NO_LAYERS, LayerTable
from services.planner.core.layers import LayerRules, near_blocks
from services.planner.core.lookup import LookupTable, Swept, sweep
from services.planner.core.roadmap import Roadmap
from services.planner.core.rows import merged
from services.planner.kernels.collision import Arm
from services.planner.kernels.lookup import count_rows

__all__ = ["Addition", "Ground", "grown"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
U8 = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Addition:
    """What joins a map of N neurons.

    Attributes:
        neurons_rad: (A, J) new neurons; they get the numbers N .. N + A - 1.
        edges: (E, 2) int32 new edges, lower neuron first, each at most once and none that the map has.
    """

    neurons_rad: F64
    edges: I32

    @property
    def is_empty(self) -> bool:
        """Whether the map had it all."""
        return len(self.neurons_rad) == 0 and len(self.edges) == 0


@dataclass(frozen=True, eq=False)
class Ground:
    """What the rows of a table depend on besides the map: arm, cells, inflation, the step along edges in metres, layers (None: none)."""

    arm: Arm
    grid: Grid
    safety_m: float
    step_m: float
    layers: LayerRules | None = None


def grown(roadmap: Roadmap, addition: Addition, ground: Ground, *, n_threads: int = 1) -> Roadmap:
    """``roadmap`` with an addition; the old one is left as it is.

    Args:
        roadmap: N neurons, M edges.
        addition: what joins it.
        ground: that of the old table.
        n_threads: that sweep the new rows; one leaves the other processors to the reflex.
    """
    if addition.is_empty:
        return roadmap
    table = _grown_table(roadmap, addition, ground, n_threads)
    learned = CognitiveMap(np.vstack([roadmap.neurons_rad, addition.neurons_rad]), np.vstack([roadmap.edges, addition.edges]))
    return Roadmap.of(learned, table, roadmap.model, (roadmap.n_built, roadmap.n_built_edges))


def _grown_table(roadmap: Roadmap, addition: Addition, ground: Ground, n_threads: int) -> LookupTable:
    swept, n_ends = _sweep_new(roadmap, addition, ground, n_threads)
    table, n, n_cells = roadmap.table, roadmap.n_neurons, ground.grid.n_cells
    node_offset = swept.node_offset[n_ends:] - swept.node_offset[n_ends]
    node_cell = swept.node_cell[swept.node_offset[n_ends] :]
    counts = np.zeros(n_cells, dtype=np.int64)
    count_rows(node_cell, counts)
    is_kept = counts[table.unavoidable] == len(addition.neurons_rad)  # a cell that a new neuron does not sweep can be avoided from now on
    unavoidable = table.unavoidable[is_kept]
    avoidable, none = _marks(table.unavoidable[~is_kept], n_cells), np.zeros(n_cells, dtype=np.uint8)
    left_out = _marks(unavoidable, n_cells)
    nodes = merged((table.node_offset, table.node_owner), n, (node_offset, node_cell), avoidable, left_out)
    # What every old neuron sweeps, no old edge sweeps beyond its ends: its rows begin empty there.
    edges = merged((table.edge_offset, table.edge_owner), roadmap.n_edges, (swept.edge_offset, swept.edge_cell), none, left_out)
    layers = _grown_layers(roadmap, addition, ground, n_threads)
    return LookupTable(*nodes, *edges, unavoidable, layers, table.barred_nodes, table.barred_edges)


def _sweep_new(roadmap: Roadmap, addition: Addition, ground: Ground, n_threads: int) -> tuple[Swept, int]:
    """Cells of the old ends of new edges, then of the new neurons, and of the new edges; how many of the neurons are old ends."""
    q, edges, n_ends = _with_old_ends(roadmap, addition)
    swept = sweep(ground.arm, ground.grid, q, edges, safety_m=ground.safety_m, step_m=ground.step_m, n_threads=n_threads)
    return swept, n_ends


def _with_old_ends(roadmap: Roadmap, addition: Addition) -> tuple[F64, I32, int]:
    """The old ends of new edges, then the new neurons; the new edges between them; how many of the neurons are old ends."""
    n = roadmap.n_neurons
    ends = np.unique(addition.edges[addition.edges < n])
    place = np.concatenate([ends, np.arange(n, n + len(addition.neurons_rad))])
    edges = np.searchsorted(place, addition.edges).astype(np.int32).reshape(-1, 2)
    return np.ascontiguousarray(np.vstack([roadmap.neurons_rad[ends], addition.neurons_rad])), edges, len(ends)


def _grown_layers(roadmap: Roadmap, addition: Addition, ground: Ground, n_threads: int) -> LayerTable:
    """The layers with the rows of what is added; a row is by block and band, all else is as for cells."""
    rules, old = ground.layers, roadmap.table.layers
    if rules is None or old.n_bands == 0:
        return NO_LAYERS
    q, edges, n_ends = _with_old_ends(roadmap, addition)
    near = near_blocks(rules, q, edges, n_threads=n_threads)
    none = np.zeros(rules.n_entries, dtype=np.uint8)
    offset, entries = near.node_offset[n_ends:] - near.node_offset[n_ends], near.node_cell[near.node_offset[n_ends] :]
    return rules.table(
        merged((old.node_offset, old.node_owner), roadmap.n_neurons, (offset, entries), none, none),
        merged((old.edge_offset, old.edge_owner), roadmap.n_edges, (near.edge_offset, near.edge_cell), none, none),
    )


def _marks(cells: I32, n_cells: int) -> U8:
    marks = np.zeros(n_cells, dtype=np.uint8)
    marks[cells] = 1
    return marks
