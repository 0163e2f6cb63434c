"""Compiling what a build needs after its motions while these are made: from nothing, compiling is a large part of a build."""

from __future__ import annotations

import numpy as np

from services.planner.config import PlannerConfig
from services.planner.core.gng import GrowingNeuralGas
from services.planner.core.roadmap import Roadmap
from services.planner.core.world import no_cells
from services.planner.offline.cycles import with_useful_cycles
from services.planner.offline.finishing import table_of
from services.planner.offline.growth import gas_parameters
from services.planner.offline.practice import rehearse
from services.planner.offline.scene import Scene

__all__ = ["compile_ahead"]

N_NEURONS, N_SAMPLES = 4, 500  # our choice: as few as make use of every kernel
TURN_RAD = 0.1  # our choice: how far the samples turn every joint


def compile_ahead(scene: Scene, config: PlannerConfig) -> None:
    """Grow a gas of a few neurons about the home pose, look whether it is free, make its table with layers, practise; nothing is kept.

    A lattice's own kernels (SOM, gamma-SOM) are not among it: they compile in a second or two.
    """
    samples = scene.robot.home_rad + np.linspace(0.0, TURN_RAD, N_SAMPLES)[:, None]
    grown = GrowingNeuralGas(gas_parameters(config.map), N_NEURONS).fit(samples, np.zeros(1, dtype=np.int64), 0).to_map()
    checker, nothing = scene.checker(), no_cells(scene.grid)
    checker.pose(nothing, grown.q_rad[0])
    checker.segment(nothing, *grown.q_rad[grown.edges[0]])
    with_useful_cycles(grown, lambda _a, _b: True, 1.0, N_NEURONS)
    rehearse(scene, config, Roadmap.of(grown, table_of(scene, config, grown, lambda _share: None), "gng"))
