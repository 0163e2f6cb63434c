"""A goal that the map has no way to, in a running stack: repair leads there, status and event say so, and then the map knows the way."""

from __future__ import annotations

import numpy as np
import pytest

from common.bus.session import Bus
from common.wire import keys
from common.wire.messages import Empty, GoalAccepted, PlannerEvent, PlanReply, PlanRequest, ServiceHealth, SetGoal
from tests.support.operator import Operator

pytestmark = pytest.mark.integration
# Forearm up and hand turned right round: no motion between the bins passes there. The way from home keeps 8 cm from everything.
FAR_FROM_THE_MAP_RAD = np.array([-0.42, -1.42, -0.98, 3.1, 2.87, -2.62])


@pytest.fixture
def operator(bus: Bus) -> Operator:
    one = Operator(bus)
    one.sees_nothing()
    one.until(lambda: one.robot is not None and one.robot.mode == "idle", "rest at home")
    return one


def _by_the_map_alone(operator: Operator, q_start: np.ndarray) -> PlanReply:
    assert operator.voxels is not None
    request = PlanRequest(
        q_start_rad=q_start,
        goal=SetGoal(q_rad=FAR_FROM_THE_MAP_RAD),
        cells=np.empty(0, dtype=np.int32),
        grid_fingerprint=operator.voxels.grid.fingerprint,
        ways=["map"],
    )
    return operator.bus.request("planner/plan", request, PlanReply, timeout_s=30.0)


def test_what_the_map_cannot_answer_repair_does_and_then_the_map_can(operator: Operator) -> None:
    assert operator.robot is not None
    home = operator.robot.q_reference_rad
    assert _by_the_map_alone(operator, home).outcome == "no_path"
    goal_id = operator.bus.request("planner/goal", SetGoal(q_rad=FAR_FROM_THE_MAP_RAD), GoalAccepted).goal_id
    ways: set[str | None] = set()

    def driven() -> bool:
        if operator.status is not None and operator.status.goal_id == goal_id and operator.status.state == "executing":
            ways.add(operator.status.way)
        return operator.reached(goal_id)

    operator.until(driven, "the goal", 60.0)
    assert "repair" in ways
    operator.until(lambda: _lessons(operator, goal_id) != [], "the lesson")
    lesson = _lessons(operator, goal_id)[0]
    assert lesson.facts["source"] == "repair" and lesson.facts["added_neurons"] > 0
    again = _by_the_map_alone(operator, home)
    assert (again.outcome, again.way) == ("path", "map"), again.reason
    assert operator.bus.request(keys.health("planner"), Empty(), ServiceHealth).counters["solved_by_repair"] >= 1
    assert operator.clearance().contacts_caused == 0


def _lessons(operator: Operator, goal_id: str) -> list[PlannerEvent]:
    return [event for event in operator.events if event.kind == "learned" and event.facts["label"] == goal_id]
