"""Taught by hand: guide, record, learn, plan with it, remember it over a start. Against a real stack with a cache of its own."""

from __future__ import annotations

import json
import os
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path

import msgpack
import numpy as np
import pytest

from clients.cli.main import main
from clients.demonstrations import DEMONSTRATIONS
from clients.stack import OwnStack, free_endpoint
from common.bus.session import Bus, BusAddress, RemoteError
from common.cache import cache_dir
from common.robot.taught import read_taught
from common.wire import keys
from common.wire.messages import (
    Ack,
    Demonstration,
    Empty,
    Guide,
    GuideReply,
    LearnReply,
    PlanReply,
    PlanRequest,
    ServiceHealth,
    ServiceInfo,
    SetGoal,
    Waypoint,
)
from deploy.processes import StackOptions
from tests.support.cell import ur3
from tests.support.operator import OVER_PLACE, Operator
from tests.support.shipped_map import build_shipped_map

pytestmark = pytest.mark.integration
HOME = ur3().home_rad.tolist()


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[OwnStack]:
    """A stack on the shipped map, in a cache that no other stack learns into; the commands of this process use it too."""
    build_shipped_map()
    ours, cache = cache_dir(), tmp_path_factory.mktemp("cache") / "tolman"
    cache.mkdir()
    for path in [*ours.glob("map-*.tolman"), *ours.glob("geometry-*.npz")]:
        (cache / path.name).symlink_to(path)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(cache.parent))
        running = OwnStack(StackOptions(BusAddress(free_endpoint(), "teaching")))
        try:
            with running.connect() as bus:
                running.wait_ready(bus, 240.0)
            yield running
        finally:
            running.stop()
    shutil.rmtree(cache.parent)


@pytest.fixture
def operator(stack: OwnStack) -> Iterator[Operator]:
    with Bus(stack.address) as bus:
        bus.request("planner/cancel", Empty(), Ack)
        for noun in ("resume", "reset"):
            bus.request(f"robot/{noun}", Empty(), Ack)
        one = Operator(bus)
        one.until(lambda: one.status is not None and one.robot is not None and one.robot.mode == "idle", "a first look")
        yield one


def neurons(operator: Operator) -> int:
    operator.look()
    assert operator.status is not None
    return operator.status.n_neurons


def tolman(stack: OwnStack, *words: str) -> int:
    return main([*words, "--connect", stack.address.endpoint, "--namespace", stack.address.namespace])


def test_guided_recorded_learned_planned_with_remembered(
    stack: OwnStack, operator: Operator, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bus, file, before = operator.bus, tmp_path / "round.json", neurons(operator)
    assert tolman(stack, "teach", "--path", "round", "--record", str(file)) == 0
    motion = read_taught(file, ur3())
    tool_m = ur3().tool_pose(motion.q_rad[-1])[:3, 3]
    np.testing.assert_allclose(tool_m, DEMONSTRATIONS["round"][-1].position_m, atol=0.01)
    assert neurons(operator) == before, "recording alone teaches nothing"

    assert tolman(stack, "teach", "--learn", str(file)) == 0
    assert "entry 1" in capsys.readouterr().out
    operator.until(lambda: operator.status is not None and operator.status.n_neurons > before, "more neurons")
    after = neurons(operator)
    (learned,) = operator.told("learned")
    assert learned.facts["label"] == "round" and learned.facts["n_neurons"] == after

    # By the paper's rules a way begins at the best match of its start, however free the straight way may be.
    question = PlanRequest(q_start_rad=motion.q_rad[-1], goal=SetGoal(pose=OVER_PLACE), rules="paper", smooth=False)
    reply = bus.request("planner/plan", question, PlanReply, timeout_s=20.0)
    assert reply.outcome == "path" and reply.neurons.max() >= before, "the way goes over what was learned"

    assert main(["map", "log", "--json"]) == 0
    entry = json.loads(capsys.readouterr().out)
    assert (entry["number"], entry["label"], entry["added_neurons"]) == (1, "round", after - before)
    _start_the_planner_anew(operator)
    assert neurons(operator) == after

    assert main(["map", "revert", "0"]) == 0
    _start_the_planner_anew(operator)
    assert neurons(operator) == before


def test_a_torn_journal_is_named_by_health_and_the_planner_works_without(operator: Operator, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["map", "log"]) == 0
    journal = Path(capsys.readouterr().out.splitlines()[-1].split(": ")[0])
    journal.write_bytes(b"torn")
    _start_the_planner_anew(operator)
    health = operator.bus.request(keys.health("planner"), Empty(), ServiceHealth)
    assert not health.ok and any(journal.name in reason for reason in health.reasons)
    with pytest.raises(RemoteError) as caught:
        operator.bus.request("planner/learn", Demonstration(q_rad=np.array([HOME, [*HOME[:5], 1.0]])), LearnReply, timeout_s=30.0)
    assert caught.value.code == "bad_journal"
    operator.go(OVER_PLACE)
    assert main(["map", "log"]) == 1 and main(["map", "revert", "0"]) == 0 and not journal.exists()
    _start_the_planner_anew(operator)
    assert operator.bus.request(keys.health("planner"), Empty(), ServiceHealth).ok


def _start_the_planner_anew(operator: Operator) -> None:
    """Kill it; the supervisor starts another."""
    operator.look()
    assert operator.status is not None
    epoch = operator.status.epoch
    os.kill(operator.bus.request(keys.info("planner"), Empty(), ServiceInfo).pid, signal.SIGKILL)
    operator.until(lambda: operator.status is not None and operator.status.epoch != epoch, "another planner", 120.0)


def test_a_guided_arm_says_so_takes_nothing_else_and_is_let_go(operator: Operator) -> None:
    bus = operator.bus
    up = Guide(op="start", waypoints=[Waypoint(position_m=[0.30, 0.11, 0.35], speed_m_s=0.05)])
    reply = bus.request("robot/guide", up, GuideReply)
    operator.until(lambda: operator.robot is not None and operator.robot.reason == "guided by hand", "the robot says so")
    assert operator.robot is not None and operator.robot.trajectory_id == reply.guide_id and operator.robot.mode == "tracking"
    with pytest.raises(RemoteError) as caught:
        bus.request("robot/guide", up, GuideReply)
    assert caught.value.code == "moving"
    assert bus.request("robot/guide", Guide(op="release"), GuideReply).guide_id == reply.guide_id
    operator.until(lambda: operator.robot is not None and operator.robot.mode == "holding", "it stands")
    assert operator.robot.reason == "the hand let go"
    operator.go(OVER_PLACE)  # and is the planner's again


def test_a_guided_arm_is_stopped_by_stop(operator: Operator) -> None:
    bus = operator.bus
    bus.request("robot/guide", Guide(op="start", waypoints=DEMONSTRATIONS["over"]), GuideReply)
    operator.until(lambda: operator.robot is not None and operator.robot.trajectory_time_s > 1.0, "it is led")
    bus.request("robot/stop", Empty(), Ack)
    operator.until(lambda: operator.robot is not None and operator.robot.mode == "holding", "it stands")
    with pytest.raises(RemoteError) as caught:
        bus.request("robot/guide", Guide(op="start", waypoints=DEMONSTRATIONS["over"]), GuideReply)
    assert caught.value.code == "refused" and "robot/stop" in str(caught.value)


def test_guiding_is_refused_while_a_trajectory_runs(operator: Operator) -> None:
    operator.send(OVER_PLACE, speed_scale=0.2)
    operator.until(lambda: operator.robot is not None and operator.robot.mode == "tracking", "the arm moves")
    with pytest.raises(RemoteError) as caught:
        operator.bus.request("robot/guide", Guide(op="start", waypoints=DEMONSTRATIONS["over"]), GuideReply)
    assert caught.value.code == "moving"


BAD_LESSONS = [
    ({"q_rad": [HOME]}, "bad_shape"),
    ({"q_rad": []}, "bad_shape"),
    ({"q_rad": [HOME[:5], HOME[:5]]}, "bad_shape"),
    ({"q_rad": [HOME, [float("nan")] * 6]}, "out_of_limits"),
    ({"q_rad": [HOME, [9.0] * 6]}, "out_of_limits"),
    ({"q_rad": [HOME, [0.0, 0.6, 0.3, 0.0, 0.0, 0.0]]}, "in_collision"),
    ({"q_rad": [HOME, HOME]}, "no_motion"),
    ({"q_rad": [HOME, [*HOME[:5], 1.0]], "t_s": [1.0, 0.0]}, "bad_times"),
    ({"q_rad": "x"}, "bad_payload"),
    ({}, "bad_payload"),
]
BAD_GUIDES = [
    ({"op": "start"}, "bad_guide"),
    ({"op": "push"}, "bad_payload"),
    ({"op": "start", "waypoints": [{"position_m": [float("nan"), 0.0, 0.0]}]}, "bad_guide"),
    ({"op": "start", "waypoints": [{"position_m": [3.0, 0.0, 0.3]}]}, "out_of_reach"),
    ({"op": "start", "waypoints": [{"position_m": [1e308, 0.0, 0.3]}]}, "too_long"),
    ({}, "bad_payload"),
]


def test_garbage_ends_nothing_and_teaches_nothing(operator: Operator) -> None:
    bus, before = operator.bus, neurons(operator)
    pids = {owner: bus.request(keys.info(owner), Empty(), ServiceInfo).pid for owner in keys.OWNERS}
    for key, cases in (("planner/learn", BAD_LESSONS), ("robot/guide", BAD_GUIDES)):
        for fields, code in cases:
            replies = list(bus.session.get(key, payload=msgpack.packb(fields), timeout=10.0))
            assert len(replies) == 1 and replies[0].err is not None, fields
            assert msgpack.unpackb(bytes(replies[0].err.payload))["code"] == code, fields
        for payload in (b"", b"\x00", b"garbage", b"\xff" * 3000):
            assert [reply.ok for reply in bus.session.get(key, payload=payload, timeout=10.0)] == [None]
    assert {owner: bus.request(keys.info(owner), Empty(), ServiceInfo).pid for owner in keys.OWNERS} == pids
    assert neurons(operator) == before
    assert bus.request(keys.health("planner"), Empty(), ServiceHealth).counters.get("step_errors", 0) == 0


def test_learning_goes_on_while_the_arm_moves(operator: Operator) -> None:
    before = neurons(operator)
    goal_id = operator.send(OVER_PLACE, speed_scale=0.2)
    operator.until(lambda: operator.robot is not None and operator.robot.mode == "tracking", "the arm moves")
    path = np.linspace(ur3().home_rad, ur3().home_rad + np.array([-1.5, -0.2, -0.4, 0.3, 0.6, 2.0]), 200)
    reply = operator.bus.request("planner/learn", Demonstration(q_rad=path, label="aside"), LearnReply, timeout_s=30.0)
    assert reply.added_neurons > 0 and reply.n_neurons == before + reply.added_neurons
    operator.until(lambda: operator.reached(goal_id), "the goal", 60.0)
    assert neurons(operator) == reply.n_neurons
    assert operator.clearance().contacts_caused == 0
