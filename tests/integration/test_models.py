"""The whole stack on a small SOM and on a small gamma-SOM: each drives to a goal and says what it is."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from clients.stack import OwnStack, free_endpoint
from common.bus.session import BusAddress, RemoteError
from common.wire.messages import Demonstration, LearnReply, PlanReply, PlanRequest, SetGoal
from deploy.processes import StackOptions
from tests.support.operator import OVER_PICK, OVER_PLACE, Operator

pytestmark = pytest.mark.integration

SIDE = 24  # units; a lattice and motions that are made in seconds
SMALL = ("planner.motions.n_trajectories=120", "planner.motions.n_samples=4000")
READY_WITHIN_S = 240.0  # the first start compiles kernels


@pytest.fixture(params=["som", "gamma_som"])
def model(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def operator(model: str) -> Iterator[Operator]:
    size = (f"planner.{model}.rows={SIDE}", f"planner.{model}.columns={SIDE}")
    options = StackOptions(BusAddress(free_endpoint(), model), overrides=(f"planner.model={model}", *size, *SMALL))
    running = OwnStack(options)
    try:
        with running.connect() as bus:
            running.wait_ready(bus, READY_WITHIN_S)
            yield Operator(bus)
    finally:
        running.stop()


def test_it_drives_on_the_lattice_and_says_so(model: str, operator: Operator) -> None:
    operator.sees_nothing()
    operator.go(OVER_PICK)
    assert operator.status is not None
    assert operator.status.model == model
    assert 0.9 * SIDE**2 < operator.status.n_neurons <= SIDE**2
    costs = {search: asked(operator, search=search) for search in ("dijkstra", "astar", "bidirectional", "wavefront")}
    assert len(costs["dijkstra"].neurons) > 0, "a straight line asks nothing of the map"
    for search in ("astar", "bidirectional"):
        assert costs[search].length_rad == pytest.approx(costs["dijkstra"].length_rad, abs=1e-6)
    assert len(costs["wavefront"].neurons) <= len(costs["dijkstra"].neurons)
    with pytest.raises(RemoteError, match=f"'gng' is not loaded; loaded is '{model}'") as caught:
        asked(operator, model="gng")
    assert caught.value.code == "unsupported"
    assert asked(operator, model=model).outcome == "path"
    assert operator.robot is not None
    path = operator.robot.q_rad + np.linspace(0.0, 0.3, 5)[:, None] * np.eye(6)[0]
    with pytest.raises(RemoteError, match=f"a {model} has a fixed grid") as caught:
        operator.bus.request("planner/learn", Demonstration(q_rad=path), LearnReply)
    assert caught.value.code == "cannot_extend"


def asked(operator: Operator, search: str | None = None, model: str | None = None) -> PlanReply:
    """The way over the place bin in an empty cell, by the paper's rules, which go by the map alone."""
    assert operator.voxels is not None
    nothing = {"cells": np.empty(0, dtype=np.int32), "grid_fingerprint": operator.voxels.grid.fingerprint}
    request = PlanRequest(goal=SetGoal(pose=OVER_PLACE), search=search, model=model, rules="paper", **nothing)
    return operator.bus.request("planner/plan", request, PlanReply, timeout_s=20.0)
