"""A trained gas learns further motions: grown from the kept map, not from nothing, so that what it could do it mostly still can.

Only a gas can: its units are as many as it needs. A SOM's are a fixed grid that is taken up by the motions it knows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from common.errors import ConfigError, TolmanError
from services.planner.config import PlannerConfig
from services.planner.core.cognitive_map import CognitiveMap, n_components, quantisation_error_rad, statistics
from services.planner.core.gng import GrowingNeuralGas
from services.planner.core.lookup import LookupTable
from services.planner.core.world import no_cells
from services.planner.kernels.collision import FREE
from services.planner.offline.config import MOST_NEURONS
from services.planner.offline.finishing import prune_grown, table_of
from services.planner.offline.growth import gas_parameters
from services.planner.offline.motions import Samples, resample
from services.planner.offline.pruning import in_largest_component, join_components, largest_component, without_collisions
from services.planner.offline.scene import Scene

__all__ = ["Extended", "extend", "refuse_lattice", "samples_to_extend_by"]

F64 = NDArray[np.float64]
Progress = Callable[[str, float], None]  # stage (map, prune, table), share done 0..1


@dataclass(frozen=True, eq=False)
class Extended:
    """The extended map with its table. ``figures``: the map's statistics on the new samples, what it held before, and their error then."""

    learned: CognitiveMap
    table: LookupTable
    figures: dict[str, Any]


def refuse_lattice(config: PlannerConfig) -> None:
    """Raises ConfigError: ``cannot_extend``: the config's model is a SOM or gamma-SOM."""
    if config.model != "gng":
        raise ConfigError(
            f"[planner] model: a {config.model} has a fixed grid and cannot be extended; train it anew with --motions",
            code="cannot_extend",
            facts={"model": config.model},
        )


def samples_to_extend_by(config: PlannerConfig, motions: Sequence[F64]) -> Samples:
    """Samples of further motions ((K, J) each): as many a neuron and as many a motion as the map was trained on, or more.

    Raises:
        TolmanError: ``bad_motions``: none of them has any length.
    """
    a_neuron, a_motion = config.motions.n_samples / config.map.n_neurons, config.motions.n_samples / config.motions.n_trajectories
    n_samples = ceil(max(a_neuron * config.extend.n_added, a_motion * len(motions), 2.0))
    try:
        return resample(list(motions), n_samples)
    except ValueError as error:
        raise TolmanError(f"cannot extend the map: {error}", code="bad_motions") from None


def extend(
    scene: Scene, config: PlannerConfig, kept: CognitiveMap, samples_rad: F64, progress: Progress = lambda _stage, _share: None
) -> Extended:
    """``kept`` after it has learned ``samples_rad`` too, free of collisions, and its table. Same arguments, same bytes.

    It has ``config.extend.n_added`` neurons more than before. Learning moves and renews only what is near the new samples; what is lost
    there (neurons that moved into collisions, edges that aged) is filled up from the new samples. What practice added apart from the rest
    (:mod:`services.planner.offline.practice`) neither moves nor goes, unless it collides here.

    Args:
        scene: robot, static layer and margins; may hold more than when ``kept`` was made: all of the map is checked anew.
        config: ``[planner.map]`` for how a gas learns, ``[planner.extend]`` for how much.
        kept: the map of a gas.
        samples_rad: (S, J) of the further motions.
        progress: called with (stage, share done).

    Raises:
        ConfigError: ``cannot_extend``: the config's model is a SOM or gamma-SOM.
        TolmanError: ``bad_motions``: samples that nothing can be learned from, or of another arm.
    """
    refuse_lattice(config)
    n_neurons = kept.n_neurons + config.extend.n_added
    if n_neurons > MOST_NEURONS:
        raise ConfigError(f"[planner.extend] n_added: {kept.n_neurons} + {config.extend.n_added} neurons are more than {MOST_NEURONS}")
    progress("map", 0.0)
    islands = _free_islands(scene, kept)
    n_taught = n_neurons - islands.n_neurons
    grown = _grown(config, largest_component(kept), samples_rad, n_taught)
    progress("map", 1.0)
    progress("prune", 0.0)
    pruned = prune_grown(scene, config, grown, samples_rad, n_taught).learned
    learned = _with_islands(scene, config, pruned, islands)
    progress("prune", 1.0)
    table = table_of(scene, config, learned, lambda share: progress("table", share))
    figures = {
        "neurons_before": kept.n_neurons,
        "edges_before": len(kept.edges),
        "quantisation_error_before_rad": quantisation_error_rad(kept, samples_rad),
        "samples": len(samples_rad),
        **asdict(statistics(learned, samples_rad)),
        "components": n_components(pruned),
        "islands": n_components(learned) - n_components(pruned),
        "table_bytes": table.n_bytes,
        "layer_bytes": table.layers.n_bytes,
    }
    return Extended(learned, table, figures)


def _free_islands(scene: Scene, kept: CognitiveMap) -> CognitiveMap:
    """What no edge joins with the largest part of a map, and is free in this scene."""
    checker, nothing = scene.checker(), no_cells(scene.grid)
    apart = kept.subset(~in_largest_component(kept))
    return without_collisions(apart, lambda q: checker.pose(nothing, q)[0] == FREE, lambda a, b: checker.segment(nothing, a, b))


def _with_islands(scene: Scene, config: PlannerConfig, pruned: CognitiveMap, islands: CognitiveMap) -> CognitiveMap:
    """Both in one map; an island that a free edge can join by now is joined."""
    if islands.n_neurons == 0:
        return pruned
    checker, nothing = scene.checker(), no_cells(scene.grid)
    both = CognitiveMap.of(np.vstack([pruned.q_rad, islands.q_rad]), np.vstack([pruned.edges, islands.edges + pruned.n_neurons]))
    return join_components(both, lambda a, b: checker.segment(nothing, a, b), config.map.bridge_max_rad)


def _grown(config: PlannerConfig, kept: CognitiveMap, samples_rad: F64, n_neurons: int) -> CognitiveMap:
    # A gas inserts once in so many signals, so the signals decide how far it can grow; a quarter more, for units that die meanwhile.
    n_signals = max(config.extend.rounds * len(samples_rad), config.map.insert_every * config.extend.n_added * 5 // 4)
    try:
        gas = GrowingNeuralGas.of_map(kept, gas_parameters(config.map), n_neurons, samples_rad)
    except ValueError as error:
        raise TolmanError(f"cannot extend the map: {error}", code="bad_motions") from None
    return gas.partial_fit(samples_rad, config.extend.seed, n_signals).to_map()
