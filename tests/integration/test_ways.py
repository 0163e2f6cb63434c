"""A goal that a poor map has no way to, in a running stack: another way leads there, the status says which, and then the map knows it."""

from __future__ import annotations

import shutil
from collections.abc import Iterator

import numpy as np
import pytest

from clients.stack import OwnStack, free_endpoint
from common.bus.session import Bus, BusAddress
from common.robot.model import cache_dir
from common.wire import keys
from common.wire.messages import Empty, PlannerEvent, PlannerStatus, PlanReply, PlanRequest, ServiceHealth, SetGoal
from deploy.processes import StackOptions
from tests.support.operator import OVER_PICK, OVER_PLACE, Operator

pytestmark = pytest.mark.integration
POOR = ("planner.motions.n_trajectories=120", "planner.motions.n_samples=4000", "planner.map.n_neurons=40")  # made in seconds
BOX_M = [0.30, 0.10]  # across the straight way from bin to bin
FRAMES = 15  # until all of a box is seen
HEIGHTS_M = np.arange(0.2, 0.7, 0.05)


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[OwnStack]:
    """A stack on a poor map, in a cache of its own: nothing was learned before, and nothing of it stays."""
    cache = tmp_path_factory.mktemp("cache") / "tolman"
    cache.mkdir()
    for path in cache_dir().glob("bodies-*.npz"):
        (cache / path.name).symlink_to(path)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(cache.parent))
        running = OwnStack(StackOptions(BusAddress(free_endpoint(), "ways"), overrides=POOR))
        try:
            with running.connect() as bus:
                running.wait_ready(bus, 300.0)
            yield running
        finally:
            running.stop()
    shutil.rmtree(cache.parent)


@pytest.fixture
def operator(stack: OwnStack) -> Iterator[Operator]:
    with Bus(stack.address) as bus:
        yield Operator(bus)


def _ask(operator: Operator, q_start: np.ndarray, cells: np.ndarray) -> PlanReply:
    """What the map alone says."""
    assert operator.voxels is not None
    on = {"cells": cells, "grid_fingerprint": operator.voxels.grid.fingerprint, "ways": ["map"]}
    request = PlanRequest(q_start_rad=q_start, goal=SetGoal(pose=OVER_PLACE), **on)  # type: ignore[arg-type]
    return operator.bus.request("planner/plan", request, PlanReply, timeout_s=60.0)


def test_what_the_map_cannot_answer_another_way_does_and_then_the_map_can(operator: Operator) -> None:
    operator.sees_nothing()
    operator.go(OVER_PICK)
    operator.until(lambda: operator.robot is not None and operator.robot.mode == "idle", "rest")
    assert operator.robot is not None
    start = operator.robot.q_reference_rad
    _box_without_a_way(operator, start)
    seen: list[tuple[PlannerStatus, np.ndarray]] = []
    goal_id = operator.send(OVER_PLACE)

    def driven() -> bool:
        status, voxels = operator.status, operator.voxels
        if status is not None and voxels is not None and status.goal_id == goal_id and status.state == "executing":
            seen.append((status, voxels.cells))
        return operator.reached(goal_id)

    operator.until(driven, "the goal", 90.0)
    first, cells = seen[0]
    assert first.way in ("repair", "fallback"), f"by {first.way}"
    operator.until(lambda: _learned(operator, goal_id) != [], "the lesson")
    learned = _learned(operator, goal_id)[0]
    assert learned.facts["source"] == first.way and learned.facts["added_neurons"] > 0
    assert operator.clearance().contacts_caused == 0
    by_map = _ask(operator, start, cells)
    assert (by_map.outcome, by_map.way) == ("path", "map"), by_map.reason
    health = operator.bus.request(keys.health("planner"), Empty(), ServiceHealth)
    assert health.counters[f"solved_by_{first.way}"] >= 1


def _learned(operator: Operator, goal_id: str) -> list[PlannerEvent]:
    return [event for event in operator.events if event.kind == "learned" and event.facts["label"] == goal_id]


def _box_without_a_way(operator: Operator, q_start: np.ndarray) -> None:
    """Put the lowest box between the bins that leaves the map no way."""
    for height_m in HEIGHTS_M:
        operator.box("box", [0.36, 0.0, float(height_m) / 2], [*BOX_M, float(height_m)])
        operator.sees(30)
        assert operator.voxels is not None
        settled = operator.voxels.seq + FRAMES
        operator.until(lambda: operator.voxels.seq >= settled, "some frames of it")  # type: ignore[union-attr]  # noqa: B023
        if _ask(operator, q_start, operator.voxels.cells).outcome == "no_path":
            return
        operator.remove("box")
        operator.sees_nothing()
    raise AssertionError("the map has a way round every box")
