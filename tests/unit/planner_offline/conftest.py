from __future__ import annotations

import pytest

from services.planner.config import MarginsConfig, PlannerConfig
from services.planner.offline.config import MapConfig, MotionsConfig, RegionConfig
from services.planner.offline.scene import Scene
from tests.support.cell import ur3_cell

PICK = RegionConfig(min_m=[0.22, -0.38, 0.10], max_m=[0.42, -0.22, 0.35])
PLACE = RegionConfig(min_m=[0.22, 0.22, 0.10], max_m=[0.42, 0.38, 0.35])


@pytest.fixture(scope="session")
def scene() -> Scene:
    return Scene.of(ur3_cell(), MarginsConfig())


@pytest.fixture(scope="session")
def small() -> PlannerConfig:
    """A config that builds in a few seconds; chunks of 30 motions, so two of them."""
    motions = MotionsConfig(pick=PICK, place=PLACE, n_trajectories=34, n_samples=1500, n_workers=1)
    return PlannerConfig(motions=motions, map=MapConfig(n_neurons=150))
