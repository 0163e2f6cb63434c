"""See, plan, move: the whole loop against a real stack, with boxes in its way."""

from __future__ import annotations

import msgpack
import msgspec
import numpy as np
import pytest

from clients.stack import OwnStack, free_endpoint
from common.bus.session import Bus, BusAddress, RemoteError
from common.geometry.grid import Grid
from common.wire import keys
from common.wire.messages import (
    Empty,
    PlannerEvent,
    PlannerStatus,
    PlanReply,
    PlanRequest,
    RobotState,
    ServiceHealth,
    ServiceInfo,
    SetGoal,
    SetObstacle,
    VoxelFrame,
)
from deploy.processes import StackOptions
from services.planner.offline.regions import box_cells
from tests.support.operator import OVER_PICK, OVER_PLACE, Operator

pytestmark = pytest.mark.integration
BETWEEN, MIDDLE_BOX = [0.36, 0.0, 0.20], [0.12, 0.10, 0.24]  # across the straight way from bin to bin

OVER_PICK_RAD = np.array([-0.9, -1.2, 1.3, -1.6, -1.57, 0.0])  # about there, clear of the wall below


@pytest.fixture
def operator(bus: Bus) -> Operator:
    one = Operator(bus)
    one.sees_nothing()
    return one


def test_it_goes_round_a_box_that_it_sees(operator: Operator) -> None:
    operator.go(OVER_PICK)
    operator.box("box", BETWEEN, MIDDLE_BOX)
    operator.sees(30)
    operator.go(OVER_PLACE)
    after = operator.clearance()
    assert after.contacts_caused == 0
    assert after.min_distance_since_reset_m > 0.0


def test_the_clearance_it_tells_is_the_engines_own_or_a_little_less(operator: Operator) -> None:
    """A box some 15 cm beside the tool, seen by real cameras: two cells, and one more for what noise adds to a box's sides."""
    operator.go(OVER_PICK)
    operator.box("box", [0.32, -0.10, 0.25], [0.06, 0.06, 0.2])
    operator.sees(30)

    def difference_m() -> float:
        assert operator.status is not None and operator.status.clearance_m is not None
        return operator.clearance().min_distance_m - operator.status.clearance_m

    operator.until(lambda: operator.status is not None and operator.status.clearance_m is not None, "a clearance")
    operator.until(lambda: 0.0 <= difference_m() <= 0.06, "the engine's clearance or a little less")


def test_a_box_that_comes_in_the_way_of_a_motion_is_dodged_or_waited_for(operator: Operator) -> None:
    operator.go(OVER_PICK)
    goal_id = operator.send(OVER_PLACE, speed_scale=0.12)  # slow: nothing may materialise inside the arm or in its braking way
    operator.until(lambda: operator.robot is not None and operator.robot.mode == "tracking", "the arm moves")
    operator.box("box", BETWEEN, MIDDLE_BOX)
    operator.until(lambda: bool({"replanned", "stopped"} & set(operator.kinds(goal_id))), "the box is answered")
    operator.until(lambda: operator.reached(goal_id) or operator.is_blocked(), "the goal, or a word that it is blocked", 60.0)
    if not operator.reached(goal_id):  # no way round from where it stands: it waits, and goes on when the box is gone
        operator.remove("box")
        operator.until(lambda: operator.reached(goal_id), "the goal", 60.0)
    assert operator.clearance().contacts_caused == 0


def test_the_shorter_way_is_taken_back_after_the_box_is_gone(operator: Operator) -> None:
    operator.go(OVER_PICK)
    position_m, size_m = _box_that_costs(operator, 0.6)
    operator.box("box", position_m, size_m)
    operator.sees(30)
    goal_id = operator.send(OVER_PLACE, speed_scale=0.08)  # slow: the shorter way must last a second before it counts
    operator.until(lambda: operator.robot is not None and operator.robot.mode == "tracking", "the arm moves")
    operator.remove("box")
    operator.until(lambda: any(e.kind == "replanned" and e.facts["rule"] == "shorter" for e in operator.events), "the shorter way")
    operator.until(lambda: operator.reached(goal_id), "the goal", 90.0)


def _box_that_costs(operator: Operator, detour_rad: float) -> tuple[list[float], list[float]]:
    """Position and size of the lowest box between the bins whose way round is longer than the free one by ``detour_rad`` at least."""
    assert operator.voxels is not None
    info = operator.voxels.grid
    grid = Grid(tuple(info.origin_m), tuple(info.shape), info.resolution_m)

    def length_rad(cells: np.ndarray) -> float | None:
        request = PlanRequest(goal=SetGoal(pose=OVER_PLACE), cells=cells, grid_fingerprint=info.fingerprint, refine=True)
        reply = operator.bus.request("planner/plan", request, PlanReply, timeout_s=20.0)
        return None if reply.trajectory is None else float(np.linalg.norm(np.diff(reply.trajectory.q_rad, axis=0), axis=1).sum())

    free_rad = length_rad(np.empty(0, dtype=np.int32))
    assert free_rad is not None
    for height_m in np.arange(0.2, 0.9, 0.05):
        position_m, size_m = [0.36, 0.0, height_m / 2], [0.2, 0.1, float(height_m)]
        half_m = np.array(size_m) / 2
        round_it_rad = length_rad(box_cells(grid, np.array(position_m) - half_m, np.array(position_m) + half_m))
        if round_it_rad is not None and round_it_rad > free_rad + detour_rad:
            return [float(value) for value in position_m], size_m
    raise AssertionError("every box can be passed at little cost, or not at all")


def test_a_goal_inside_live_cells_waits_until_it_is_free(operator: Operator) -> None:
    operator.go(OVER_PICK)
    operator.box("box", [0.32, 0.30, 0.20], [0.1, 0.1, 0.1])
    operator.sees(30)
    goal_id = operator.send(OVER_PLACE)
    operator.until(lambda: operator.status is not None and operator.status.state == "blocked", "blocked")
    assert operator.status is not None and "goal" in operator.status.reason
    operator.remove("box")
    operator.until(lambda: operator.reached(goal_id), "the goal", 60.0)


def test_no_way_is_an_answer(operator: Operator) -> None:
    operator.look()
    assert operator.voxels is not None
    grid = operator.voxels.grid
    x, y, z = (grid.origin_m[k] + (np.arange(grid.shape[k]) + 0.5) * grid.resolution_m for k in range(3))
    cells = np.zeros(grid.shape, dtype=bool)
    # A wall between the bins, open only round the shoulder: no way from one bin to the other.
    cells[:, np.abs(y) < 0.04, :] = ~np.logical_and.outer(np.abs(x) < 0.22, z < 0.46)[:, None, :]

    def ask(occupied: np.ndarray) -> PlanReply:
        request = PlanRequest(
            goal=SetGoal(pose=OVER_PLACE),
            q_start_rad=OVER_PICK_RAD,
            cells=occupied.astype(np.int32),
            grid_fingerprint=grid.fingerprint,
            ways=["map"],  # the others would look for one for seconds
        )
        return operator.bus.request("planner/plan", request, PlanReply, timeout_s=20.0)

    reply = ask(np.flatnonzero(cells))
    assert reply.outcome == "no_path", reply.reason
    assert "neurons blocked" in reply.reason and len(reply.neurons) == 0
    assert ask(np.empty(0)).outcome == "path"


def test_a_refined_answer_comes_when_asked_for(operator: Operator) -> None:
    """A post in the middle of the way from bin to bin, so that it is no straight line."""
    operator.look()
    assert operator.voxels is not None
    grid = operator.voxels.grid
    x, y, z = (grid.origin_m[k] + (np.arange(grid.shape[k]) + 0.5) * grid.resolution_m for k in range(3))
    post = np.abs(x - 0.35)[:, None, None] + np.zeros(grid.shape) < 0.08
    cells = np.flatnonzero(post & (np.abs(y) < 0.05)[None, :, None] & (z < 0.3)[None, None, :]).astype(np.int32)

    def ask(refine: bool | None) -> PlanReply:
        question = PlanRequest(goal=SetGoal(pose=OVER_PLACE), q_start_rad=OVER_PICK_RAD, cells=cells, grid_fingerprint=grid.fingerprint)
        return operator.bus.request("planner/plan", msgspec.structs.replace(question, refine=refine), PlanReply, timeout_s=20.0)

    first, refined = ask(None), ask(True)
    assert first.outcome == refined.outcome == "path"
    assert "refine" not in first.timing_ms and "refine" in refined.timing_ms and not first.refined
    assert first.trajectory is not None and refined.trajectory is not None
    lengths = [np.linalg.norm(np.diff(reply.trajectory.q_rad, axis=0), axis=1).sum() for reply in (first, refined)]
    assert lengths[1] <= lengths[0] and (lengths[1] < lengths[0]) == refined.refined
    np.testing.assert_allclose(refined.trajectory.q_rad[[0, -1]], refined.path_q_rad[[0, -1]], atol=1e-9)


def test_an_arm_with_a_hand_within_its_inflation_gets_out(operator: Operator) -> None:
    operator.go(OVER_PICK)
    # 3 cm beside the gripper (6 cm wide, tip at z = 0.20), as near as a polite hand comes.
    operator.box("hand", [0.32, -0.30 + 0.03 + 0.03 + 0.03, 0.26], [0.06, 0.06, 0.06])
    operator.sees(5)
    operator.go(OVER_PLACE)
    assert operator.clearance().contacts_caused == 0


def test_questions_move_nothing(operator: Operator) -> None:
    operator.look()
    reply = operator.bus.request("planner/plan", PlanRequest(goal=SetGoal(pose=OVER_PLACE)), PlanReply, timeout_s=20.0)
    assert reply.outcome == "path" and reply.trajectory is not None and reply.length_rad > 0.0
    assert reply.path_q_rad.shape == (len(reply.neurons) + 2, 6)
    state = operator.bus.get_state("robot/state", RobotState)[0]
    assert state.mode == "idle"


@pytest.mark.parametrize(
    ("request_", "code"),
    [
        (PlanRequest(goal=SetGoal(q_rad=[9.0] * 6)), "out_of_limits"),  # type: ignore[arg-type]
        (PlanRequest(goal=SetGoal(q_rad=[0.0] * 5)), "out_of_limits"),  # type: ignore[arg-type]
        (PlanRequest(goal=SetGoal(q_rad=[float("nan")] * 6)), "out_of_limits"),  # type: ignore[arg-type]
        (PlanRequest(goal=SetGoal(q_rad=[0.0, 0.6, 0.3, 0.0, 0.0, 0.0])), "in_collision"),  # type: ignore[arg-type]
        (PlanRequest(goal=SetGoal(name="nowhere")), "unknown_name"),
        (PlanRequest(goal=SetGoal()), "bad_goal"),
        (PlanRequest(goal=SetGoal(name="home"), cells=[1], grid_fingerprint="other"), "foreign_grid"),  # type: ignore[arg-type]
        (PlanRequest(goal=SetGoal(name="home"), model="other"), "unsupported"),
    ],
)
def test_impossible_questions_are_errors_that_name_the_value(bus: Bus, request_: PlanRequest, code: str) -> None:
    with pytest.raises(RemoteError) as caught:
        bus.request("planner/plan", request_, PlanReply, timeout_s=20.0)
    assert caught.value.code == code


def test_late_joiners_get_the_state(stack: OwnStack, operator: Operator) -> None:
    operator.go(OVER_PICK)
    with Bus(stack.address) as late:
        assert late.get_state("planner/status", PlannerStatus)[0].n_neurons > 0
        assert late.get_state("robot/state", RobotState)[0].q_rad.shape == (6,)
        assert late.get_state("perception/voxels", VoxelFrame)[0].grid.resolution_m == 0.02
        events = late.get_state("planner/event", PlannerEvent)
        assert "goal_reached" in {event.kind for event in events}
        assert len({event.number for event in events}) == len(events)


GARBAGE = [b"", b"\x00", b"garbage", msgpack.packb(7), msgpack.packb({"q_rad": "x"}), msgpack.packb({"cells": [{}] * 50}), b"\xff" * 3000]


def test_garbage_on_every_key_ends_nothing(operator: Operator) -> None:
    bus = operator.bus
    pids = {owner: bus.request(keys.info(owner), Empty(), ServiceInfo).pid for owner in keys.OWNERS}
    for channel in keys.CHANNELS:
        for concrete in _concrete(channel.key):
            for payload in GARBAGE:
                if channel.kind is keys.Kind.STATE:
                    bus.session.put(concrete, payload)
                elif concrete not in ("robot/stop", "robot/reset"):  # any map is a well-formed order to these
                    for reply in bus.session.get(concrete, payload=payload, timeout=5.0):
                        assert reply.ok is not None or reply.err is not None
    operator.until(lambda: True, "still there")
    assert {owner: bus.request(keys.info(owner), Empty(), ServiceInfo).pid for owner in keys.OWNERS} == pids
    assert bus.request(keys.health("planner"), Empty(), ServiceHealth).counters["bad_payloads"] > 0
    operator.go(OVER_PLACE)


def _concrete(key: str) -> list[str]:
    if key.startswith("camera/"):
        return [key.replace("*", "front_left")]
    return [key.replace("*", owner) for owner in keys.OWNERS] if key.startswith("*") else [key]


def test_bad_obstacles_are_refused(bus: Bus) -> None:
    for request in (
        SetObstacle(op="remove", id="nobody"),
        SetObstacle(op="add", id="x", shape="box", size_m=[0.1, -0.1, 0.1], position_m=[0.5, 0, 0.5]),
        SetObstacle(op="add", id="x", shape="box", size_m=[0.1, 0.1, 0.1], position_m=[float("nan"), 0, 0.5]),
    ):
        with pytest.raises(RemoteError):
            bus.request("robot/obstacle", request, Empty)


def test_the_papers_own_rules_run_end_to_end() -> None:
    options = StackOptions(BusAddress(free_endpoint(), "paper"), overrides=("planner.rules=paper",))
    running = OwnStack(options)
    try:
        with running.connect() as bus:
            running.wait_ready(bus, 240.0)
            operator = Operator(bus)
            operator.go(OVER_PICK)
            operator.box("box", BETWEEN, MIDDLE_BOX)
            operator.sees(30)
            operator.go(OVER_PLACE)
            assert operator.status is not None and operator.status.rules == "paper"
    finally:
        running.stop()
