"""robot_sim as a process of its own, behind a real router, with a planner and eyes played by the test."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec
import numpy as np
import pytest

from common.bus.session import Bus, BusAddress, RemoteError, Router
from common.clock import utc_ns
from common.wire import keys
from common.wire.messages import (
    Ack,
    Clearance,
    Empty,
    Grasp,
    HeldBox,
    RobotState,
    Scene,
    ServiceHealth,
    ServiceInfo,
    SetObstacle,
    Trajectory,
    Waypoint,
)
from services.robot_sim.core.limits import Limits
from tests.support.cell import ur3
from tests.support.eventually import eventually
from tests.support.robot_sim_curves import straight

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.integration

SENSES = r"""
import sys, threading
from common.bus.session import Bus, BusAddress
from common.clock import utc_ns
from common.wire.messages import *
import numpy as np
with Bus(BusAddress(sys.argv[1])) as bus:
    status = bus.publisher("planner/status", PlannerStatus)
    voxels = bus.publisher("perception/voxels", VoxelFrame)
    for owner in sys.argv[2:]:
        bus.declare_alive(owner)
    over = threading.Event()
    while not over.wait(0.05):
        if "planner" in sys.argv:
            status.publish(PlannerStatus(state="idle", reason="", rules="checked", model="m", n_neurons=0, n_blocked=0,
                                         timing_ms={}, replans=0, accepted=0))
        if "perception" in sys.argv:
            now = utc_ns()
            camera = CameraUse(name="front", seq=1, exposure_ns=now - 50_000_000, used=True, published_ns=now)
            grid = GridInfo(origin_m=[0, 0, 0], shape=[1, 1, 1], resolution_m=0.1, fingerprint="")
            voxels.publish(VoxelFrame(grid=grid, cells=np.zeros(0, np.int32), cameras=[camera], robot_seq=0, timing_ms={}))
"""


class Cell:
    """A running robot_sim and a client's view of it."""

    def __init__(self, bus: Bus, process: subprocess.Popen[bytes], endpoint: str) -> None:
        self.bus, self.process, self.endpoint = bus, process, endpoint
        self._states = bus.latest("robot/state", RobotState)
        self._trajectories = bus.publisher("planner/trajectory", Trajectory)
        self._state: RobotState | None = None
        self.count = 0

    def state(self) -> RobotState:
        def newest() -> RobotState | None:
            received = self._states.take()
            if received is not None:
                self._state = received.message
            return self._state if received is not None else None

        return eventually(newest, 5.0, "a robot/state")

    def until(self, what: str, holds: Callable[[RobotState], bool], timeout_s: float = 10.0) -> RobotState:
        def look() -> RobotState | None:
            state = self.state()
            return state if holds(state) else None

        return eventually(look, timeout_s, what)

    def send(self, q_to: np.ndarray, **changes: object) -> Trajectory:
        robot = ur3()
        limits = Limits(robot.position_min_rad, robot.position_max_rad, robot.max_velocity_rad_s, robot.max_acceleration_rad_s2)
        line = straight(self.state().q_reference_rad, q_to, limits)
        self.count += 1
        fields = {"id": f"t{self.count}", "goal_id": "g", "kind": "motion", "start_ns": utc_ns() + 20_000_000, "voxels_seq": 0}
        fields |= {"t_s": line.t_s, "q_rad": line.q_rad, "dq_rad_s": line.dq_rad_s, **changes}
        return self._trajectories.publish(Trajectory(**fields))  # type: ignore[arg-type]

    def ask(self, noun: str) -> Ack:
        return self.bus.request(f"robot/{noun}", Empty(), Ack)

    def obstacle(self, **fields: object) -> Ack:
        return self.bus.request("robot/obstacle", SetObstacle(**fields), Ack)  # type: ignore[arg-type]

    def clearance(self) -> Clearance:
        return self.bus.request("robot/clearance", Empty(), Clearance)

    def health(self) -> ServiceHealth:
        return self.bus.request("robot/health", Empty(), ServiceHealth)


HOME = np.array(ur3().home_rad)
AWAY = HOME + np.array([1.6, 0.0, 0.0, 0.5, 0.0, 0.0])


def start_cell(*options: str) -> Iterator[Cell]:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    with Router(endpoint):
        process = subprocess.Popen([sys.executable, "-m", "services.robot_sim", "--connect", endpoint, *options])
        try:
            with Bus(BusAddress(endpoint)) as bus:
                eventually(lambda: "robot" in bus.alive_owners(), 60.0, "robot_sim's liveliness")
                yield Cell(bus, process, endpoint)
        finally:
            process.send_signal(signal.SIGINT)
            assert process.wait(10.0) == 0


@pytest.fixture(scope="module")
def alone() -> Iterator[Cell]:
    yield from start_cell("--set", "robot_sim.watchdog=false")


@pytest.fixture(scope="module")
def watched() -> Iterator[Cell]:
    yield from start_cell()


@pytest.fixture
def cell(alone: Cell) -> Cell:
    alone.ask("resume")
    alone.ask("reset")
    alone.obstacle(op="clear")
    alone.until("standing at home", lambda s: s.mode == "idle" and np.allclose(s.q_rad, HOME, atol=1e-3))
    return alone


def test_drives_a_trajectory_within_the_tracking_limit(cell: Cell) -> None:
    sent = cell.send(AWAY)
    moving = cell.until("tracking", lambda s: s.mode == "tracking" and s.trajectory_time_s > 0.1)
    assert moving.trajectory_id == sent.id and moving.dq_reference_rad_s is not None
    assert 0 < moving.trajectory_accepted_ns - sent.stamp_ns < 500_000_000
    done = cell.until("idle", lambda s: s.mode == "idle")
    assert done.trajectory_id == sent.id
    assert np.allclose(done.q_reference_rad, AWAY, atol=1e-12)
    assert cell.clearance().tracking_error_max_rad <= 0.02
    health = cell.health()
    assert health.rates_hz["cycle"] == pytest.approx(125.0, rel=0.1)
    assert cell.bus.request("robot/info", Empty(), ServiceInfo).fingerprints == {"robot": ur3().fingerprint}


def test_stop_resume_and_refusals_are_told(cell: Cell) -> None:
    cell.send(AWAY)
    cell.until("tracking", lambda s: s.mode == "tracking" and s.trajectory_time_s > 0.3)
    cell.ask("stop")
    held = cell.until("holding", lambda s: s.mode == "holding")
    assert "robot/stop" in held.reason and np.abs(held.dq_rad_s).max() < 0.02
    refused = cell.health().counters.get("trajectories_refused", 0)
    cell.send(HOME)
    cell.until("the refusal in the reason", lambda s: "refused" in s.reason)
    assert cell.health().counters["trajectories_refused"] == refused + 1
    cell.ask("resume")
    cell.send(HOME)
    cell.until("home again", lambda s: s.mode == "idle" and np.allclose(s.q_rad, HOME, atol=1e-3))


def test_only_motions_that_reckon_with_what_is_held_are_driven(cell: Cell) -> None:
    def grasp(box: HeldBox | None) -> None:
        cell.bus.request("robot/grasp", Grasp(op="release" if box is None else "grasp", box=box), Ack)

    box = HeldBox(size_m=[0.05, 0.05, 0.08])
    grasp(box)
    assert cell.until("the box is told", lambda s: s.held is not None).held == box
    for wrong in (None, HeldBox(size_m=[0.05, 0.05, 0.09])):
        sent = cell.send(AWAY, held=wrong)
        refused = cell.until("the refusal", lambda s, id=sent.id: s.trajectory_refused_id == id)  # type: ignore[misc]
        assert "what the gripper holds" in refused.reason and refused.mode == "idle"
    cell.send(AWAY, held=box)
    cell.until("tracking", lambda s: s.mode == "tracking" and s.trajectory_time_s > 0.1)
    grasp(box)  # the same again: nothing to do
    with pytest.raises(RemoteError, match="moving"):
        grasp(None)
    cell.until("there", lambda s: s.mode == "idle" and np.allclose(s.q_rad, AWAY, atol=1e-3))
    grasp(None)
    assert cell.until("nothing is held", lambda s: s.held is None).mode == "idle"
    cell.send(HOME)
    cell.until("home again", lambda s: s.mode == "idle" and np.allclose(s.q_rad, HOME, atol=1e-3))


def test_obstacles_appear_move_and_go(cell: Cell) -> None:
    scenes = cell.bus.latest("robot/scene", Scene)

    def scene(holds: Callable[[Scene], bool]) -> Scene:
        newest: list[Scene] = []

        def look() -> bool:
            newest.extend(received.message for received in scenes.take_all())
            return bool(newest) and holds(newest[-1])

        eventually(look, 5.0, "the scene")
        return newest[-1]

    cell.obstacle(op="add", id="box", shape="box", size_m=[0.1, 0.1, 0.1], position_m=[0.6, 0.0, 0.5])
    assert scene(lambda s: len(s.obstacles) == 1).obstacles[0].id == "box"
    cell.obstacle(op="script", id="box", script=[Waypoint(position_m=[0.6, 0.3, 0.5], speed_m_s=0.3)])
    moving = scene(lambda s: s.obstacles[0].velocity_m_s != [0.0, 0.0, 0.0])
    assert moving.obstacles[0].velocity_m_s == pytest.approx([0.0, 0.3, 0.0])
    scene(lambda s: s.obstacles[0].position_m == pytest.approx([0.6, 0.3, 0.5]))
    cell.obstacle(op="remove", id="box")
    scene(lambda s: not s.obstacles)
    assert cell.bus.get_state("robot/scene", Scene)[0].obstacles == []  # a late joiner


def test_a_scripted_hand_waits_before_a_standing_arm(cell: Cell) -> None:
    tool = ur3().tool_pose(HOME)[:3, 3]
    hand = {"shape": "sphere", "size_m": [0.05], "position_m": (tool + np.array([0.3, 0.0, 0.0])).tolist()}
    cell.obstacle(op="add", id="hand", **hand, script=[Waypoint(position_m=tool.tolist(), speed_m_s=0.5)])
    reached: list[float] = []

    def waits() -> bool:
        reached.append(cell.clearance().min_obstacle_distance_m or 0.0)
        return len(reached) > 3 and reached[-1] == reached[-3] < 0.05

    eventually(waits, 10.0, "the hand to wait")
    assert 0.03 <= reached[-1] < 0.036
    assert cell.clearance().contacts == 0


def test_driving_into_a_wall_is_a_caused_contact_and_a_fault_that_reset_ends(cell: Cell) -> None:
    tool = ur3().tool_pose(HOME + np.array([0.8, 0, 0, 0.25, 0, 0]))[:3, 3]
    cell.obstacle(op="add", id="wall", shape="sphere", size_m=[0.1], position_m=tool.tolist())
    sent = cell.send(AWAY)
    cell.until("the end of it", lambda s: s.trajectory_id == sent.id and s.mode in ("idle", "fault"))
    clearance = cell.clearance()
    assert clearance.contacts_caused >= 1 and clearance.contacts == clearance.contacts_caused + clearance.contacts_suffered
    assert {other for _, other in clearance.contact_pairs} == {"wall"}
    cell.obstacle(op="clear")
    cell.ask("reset")
    assert cell.clearance().contacts == 0
    cell.until("idle at home, all forgotten", lambda s: s.mode == "idle" and s.trajectory_id == "")


@pytest.mark.parametrize(
    ("fields", "code"),
    [
        ({"op": "remove", "id": "nobody"}, "unknown_id"),
        ({"op": "move", "id": "nobody", "position_m": [0.0, 0.0, 0.0]}, "unknown_id"),
        ({"op": "add", "id": "m", "shape": "mesh", "mesh": "hand", "size_m": [1.0], "position_m": [0.0, 0.0, 0.0]}, "unsupported_shape"),
        ({"op": "add", "id": "table", "shape": "sphere", "size_m": [0.1], "position_m": [0.0, 0.0, 0.9]}, "bad_request"),
        ({"op": "add", "id": "x", "shape": "sphere", "size_m": [0.1], "position_m": [0.0, 0.0, float("nan")]}, "bad_request"),
        ({"op": "add", "id": "x", "shape": "sphere", "size_m": [0.1]}, "bad_request"),
        (
            {"op": "add", "id": "x", "shape": "sphere", "size_m": [0.1], "position_m": [0.0, 0.0, 0.9], "script": []},
            "bad_request",
        ),
    ],
)
def test_impossible_obstacles_are_refused_by_name(cell: Cell, fields: dict[str, object], code: str) -> None:
    with pytest.raises(RemoteError) as caught:
        cell.obstacle(**fields)
    assert caught.value.code == code
    assert cell.bus.get_state("robot/scene", Scene)[0].obstacles == []


@pytest.mark.parametrize("payload", [b"\xff\x00garbage", b"", b"\x90", msgspec.msgpack.encode({"id": 7, "op": "explode", "t_s": "x"})])
def test_garbage_on_every_key_is_counted_and_survived(cell: Cell, payload: bytes) -> None:
    before = cell.health().counters.get("bad_payloads", 0)
    for key in ("planner/trajectory", "planner/status", "perception/voxels"):
        cell.bus.session.put(key, payload)
    for noun in ("obstacle", "stop", "resume", "reset", "clearance", "info", "health"):
        for answer in cell.bus.session.get(f"robot/{noun}", payload=payload, timeout=5.0):
            decoded = msgspec.msgpack.decode(bytes((answer.ok or answer.err).payload))
            assert isinstance(decoded, dict), noun
            if answer.ok is None:
                assert decoded["code"] == "bad_payload" and decoded["message"]
    eventually(lambda: cell.health().counters["bad_payloads"] >= before + 3, 5.0, "the count of bad payloads")
    assert cell.process.poll() is None
    cell.ask("resume")
    cell.send(AWAY)
    cell.until("it still drives", lambda s: s.mode == "tracking")


def play(cell: Cell, *owners: str) -> subprocess.Popen[bytes]:
    process = subprocess.Popen([sys.executable, "-c", SENSES, cell.endpoint, *owners], cwd=ROOT)
    eventually(lambda: set(owners) <= set(cell.bus.alive_owners()), 30.0, f"{owners} to be there")
    return process


def kill_in_mid_motion(cell: Cell, owner: str, sense: subprocess.Popen[bytes]) -> np.ndarray:
    """Returns where the arm was to go."""
    cell.until("all senses", lambda s: s.mode == "idle" and not s.reason, 20.0)
    target = AWAY if np.allclose(cell.state().q_rad, HOME, atol=0.5) else HOME
    cell.send(target)
    cell.until("speed", lambda s: s.mode == "tracking" and bool(np.abs(s.dq_rad_s).max() > 1.0))
    sense.kill()
    killed = time.monotonic()
    held = cell.until("standing", lambda s: s.mode == "holding", 5.0)
    took_s = time.monotonic() - killed
    assert owner in held.reason
    assert np.abs(held.dq_rad_s).max() < 0.02
    robot = ur3()
    brake_s = float((robot.max_velocity_rad_s / robot.max_acceleration_rad_s2).max())
    assert took_s <= 0.25 + brake_s + 0.05 + 0.1  # and how long the test takes to see it
    return target


def test_kill_of_any_sense_in_mid_motion_stops_the_arm_in_time_and_work_goes_on(watched: Cell) -> None:
    senses = {owner: play(watched, owner) for owner in ("planner", "perception", "cameras")}
    try:
        for owner in ("planner", "perception", "cameras"):
            target = kill_in_mid_motion(watched, owner, senses[owner])
            watched.send(target)
            watched.until("the refusal", lambda s: "refused" in s.reason)
            senses[owner].wait()
            senses[owner] = play(watched, owner)
            watched.until("idle by itself", lambda s: s.mode == "idle", 10.0)
            watched.send(target)
            watched.until("work to go on", lambda s, goal=target: s.mode == "idle" and np.allclose(s.q_rad, goal, atol=1e-3))
    finally:
        for process in senses.values():
            process.kill()
            process.wait()


def test_keys_are_those_of_the_contract() -> None:
    assert {c.key for c in keys.CHANNELS if c.key.startswith("robot/")} == {
        "robot/guide", "robot/grasp", "robot/state", "robot/scene", "robot/obstacle", "robot/stop", "robot/resume", "robot/reset",
        "robot/clearance",
    }  # fmt: skip
