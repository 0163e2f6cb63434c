"""From what a model grew to what can be driven: free of collisions in this scene, and with its table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from common.errors import TolmanError
from common.geometry.grid import Grid
from services.planner.config import PlannerConfig
from services.planner.core.cognitive_map import CognitiveMap
from services.planner.core.layers import LayerRules, build_layers
from services.planner.core.lookup import LookupTable, build_table
from services.planner.core.neuron_index import in_order_of_place
from services.planner.core.world import no_cells
from services.planner.kernels.collision import FREE, Arm
from services.planner.offline.cycles import with_useful_cycles
from services.planner.offline.pruning import prune, prune_lattice
from services.planner.offline.scene import Scene

__all__ = ["CheckedMap", "layer_rules", "prune_grown", "table_of"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class CheckedMap:
    """A map that is free; ``lattice_unit`` (N,) int32 says which unit of its lattice each neuron is, None for a gas."""

    learned: CognitiveMap
    lattice_unit: I32 | None = None


def prune_grown(scene: Scene, config: PlannerConfig, grown: CognitiveMap, samples_rad: F64, n_neurons: int | None = None) -> CheckedMap:
    """The map of the chosen model as :mod:`services.planner.offline.pruning` says: a gas is filled up, gets useful cycles and is
    numbered anew, a lattice keeps to its lattice.

    Args:
        scene: what it must not hit.
        config: the model, and for a gas how it is mended.
        grown: all that the model grew.
        samples_rad: (S, J) where a gas takes missing neurons from.
        n_neurons: of the gas in the end (default: the config's).

    Raises:
        TolmanError: ``unreachable`` if nothing is left of a lattice.
    """
    checker, nothing = scene.checker(), no_cells(scene.grid)

    def pose_is_free(q: F64) -> bool:
        return checker.pose(nothing, q)[0] == FREE

    def motion_is_free(a: F64, b: F64) -> bool:
        return checker.segment(nothing, a, b)

    if config.model != "gng":
        try:
            return CheckedMap(*prune_lattice(grown, pose_is_free=pose_is_free, motion_is_free=motion_is_free))
        except ValueError as error:
            raise TolmanError(f"[planner.{config.model}]: {error}", code="unreachable") from None
    m = config.map
    learned = prune(
        grown,
        samples_rad,
        m.n_neurons if n_neurons is None else n_neurons,
        pose_is_free=pose_is_free,
        motion_is_free=motion_is_free,
        bridge_max_rad=m.bridge_max_rad,
        join_neighbours=m.join_neighbours,
    )
    if m.cycle_neighbours > 0:
        learned = with_useful_cycles(learned, motion_is_free, m.cycle_stretch, m.cycle_neighbours)
    return CheckedMap(in_order_of_place(learned))


def table_of(scene: Scene, config: PlannerConfig, learned: CognitiveMap, progress: Callable[[float], None]) -> LookupTable:
    """The lookup table of a map in its scene, with its layers; ``progress`` is called with the share done."""
    rules = layer_rules(scene.arm, scene.grid, config)
    share = 1.0 if rules is None else 0.5
    table = build_table(
        scene.arm,
        scene.grid,
        learned.q_rad,
        learned.edges,
        safety_m=scene.margins.safety_m,
        step_m=scene.margins.edge_step_m,
        progress=lambda done, total: progress(share * done / total),
    )
    if rules is None:
        return table
    layers = build_layers(rules, learned.q_rad, learned.edges, lambda done, total: progress(share + (1.0 - share) * done / total))
    return replace(table, layers=layers)


def layer_rules(arm: Arm, grid: Grid, config: PlannerConfig) -> LayerRules | None:
    """The rules of the layers that the config asks for; None if for none."""
    clearance, margins = config.clearance, config.margins
    if not clearance.layers_m:
        return None
    return LayerRules.of(arm, grid, clearance.layers_m, clearance.block_m, safety_m=margins.safety_m, step_m=margins.edge_step_m)
