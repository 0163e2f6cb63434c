"""A box in the gripper: physics, cameras, perception and planner reckon with it. Against a real stack."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from common.bus.session import Bus, RemoteError
from common.wire.messages import Ack, Empty, Grasp, HeldBox
from tests.support.operator import OVER_PICK, OVER_PLACE, Operator

pytestmark = pytest.mark.integration
BOX = HeldBox(size_m=[0.05, 0.05, 0.08], position_m=[0.0, 0.0, 0.03])
READY_WITHIN_S = 5.0  # issue: a payload's table is there in under 5 s


@pytest.fixture
def operator(bus: Bus) -> Iterator[Operator]:
    one = Operator(bus)
    one.sees_nothing()
    yield one
    bus.request("planner/cancel", Empty(), Ack)
    one.until(lambda: one.robot is not None and one.robot.mode != "tracking", "the arm stands")
    bus.request("robot/grasp", Grasp(op="release"), Ack)
    one.until(lambda: one.status is not None and one.status.held is None, "the planner knows that nothing is held")


def held_size(operator: Operator) -> list[float] | None:
    return None if operator.status is None or operator.status.held is None else operator.status.held.size_m


def test_it_plans_and_drives_with_a_box_and_without_it_again(operator: Operator) -> None:
    operator.bus.request("robot/grasp", Grasp(op="grasp", box=BOX), Ack)
    operator.until(lambda: held_size(operator) == BOX.size_m, "the planner is ready for the box", READY_WITHIN_S)
    told = next(event for event in operator.events if event.kind == "held")
    assert told.facts["size_m"] == BOX.size_m and told.facts["seconds"] < READY_WITHIN_S
    operator.go(OVER_PICK)
    assert operator.voxels is not None and len(operator.voxels.cells) == 0, "the box is the arm, and no obstacle"
    operator.box("post", [0.36, 0.0, 0.20], [0.12, 0.10, 0.24])
    operator.sees(30)
    operator.go(OVER_PLACE)
    assert operator.clearance().contacts_caused == 0
    operator.bus.request("robot/grasp", Grasp(op="release"), Ack)
    operator.until(lambda: operator.status is not None and operator.status.held is None, "the planner is ready without it", READY_WITHIN_S)
    operator.bus.request("robot/grasp", Grasp(op="grasp", box=BOX), Ack)
    operator.until(lambda: held_size(operator) == BOX.size_m, "the same box again, from what was kept", 1.0)


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        (Grasp(op="grasp"), "a box is needed"),
        (Grasp(op="release", box=BOX), "none to release"),
        (Grasp(op="grasp", box=HeldBox(size_m=[0.1, 0.1, 3.0])), "size_m: .*3.0"),
    ],
)
def test_nonsense_is_refused(operator: Operator, request_: Grasp, words: str) -> None:
    with pytest.raises(RemoteError, match=words):
        operator.bus.request("robot/grasp", request_, Ack)


def test_an_arm_in_motion_grasps_nothing(operator: Operator) -> None:
    operator.send(OVER_PICK, speed_scale=0.2)
    operator.until(lambda: operator.robot is not None and operator.robot.mode == "tracking", "the arm moves")
    with pytest.raises(RemoteError, match="moving"):
        operator.bus.request("robot/grasp", Grasp(op="grasp", box=BOX), Ack)
