"""The stack as a whole: it comes up, comes back after kills, says what it does, and leaves nothing behind."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from clients.stack import OwnStack, free_endpoint
from common.bus.session import Bus, BusAddress
from common.wire import keys
from common.wire.messages import Empty, RobotState, ServiceInfo
from deploy.processes import StackOptions
from deploy.rundir import RunDirectory
from tests.support.eventually import eventually
from tests.support.repository import ROOT

pytestmark = pytest.mark.integration
READY_WITHIN_S = 240.0


def tolman(*words: str, timeout_s: float = 120.0) -> subprocess.CompletedProcess[str]:
    line = [sys.executable, "-m", "clients.cli.main", *words]
    return subprocess.run(line, cwd=ROOT, capture_output=True, text=True, check=False, timeout=timeout_s)


def place(stack: OwnStack) -> list[str]:
    return ["--connect", stack.address.endpoint, "--namespace", stack.address.namespace]


def info_of(bus: Bus, owner: str) -> ServiceInfo:
    return bus.request(keys.info(owner), Empty(), ServiceInfo)


def test_every_owner_is_alive_and_tells_its_config(bus: Bus) -> None:
    assert bus.alive_owners() == sorted(keys.OWNERS)
    for owner in keys.OWNERS:
        info = info_of(bus, owner)
        assert info.owner == owner
        assert info.config


def test_status_shows_every_channel_at_its_rate(stack: OwnStack, bus: Bus) -> None:
    result = tolman("status", "--json", *place(stack))
    shown = json.loads(result.stdout)
    assert set(shown["alive"]) == set(keys.OWNERS)
    assert all(shown["alive"].values())
    channels = shown["channels"]
    assert sum(key.startswith("camera/") for key in channels) == 4
    assert {"robot/state", "robot/scene", "perception/voxels", "planner/status"} <= set(channels)
    assert channels["robot/state"]["rate_hz"] > 60.0  # half of the nominal rate: the machine may be busy


def test_a_goal_is_sent_and_waited_for_at_the_command_line(stack: OwnStack, bus: Bus) -> None:
    result = tolman("goal", "--pose", "0.32", "0.30", "0.20", "--wait", "--json", *place(stack))
    assert result.returncode == 0, result.stdout + result.stderr
    assert json.loads(result.stdout)["kind"] == "goal_reached"
    plan = tolman("plan", "--pose", "0.32", "-0.30", "0.20", "--json", *place(stack))
    assert plan.returncode == 0, plan.stdout + plan.stderr
    assert json.loads(plan.stdout)["outcome"] == "path"


def test_a_bad_goal_is_one_line_and_an_exit_code(stack: OwnStack, bus: Bus) -> None:
    result = tolman("goal", "--q", "0", "0", "0", *place(stack))
    assert result.returncode == 1
    assert len(result.stderr.strip().splitlines()) == 1
    assert "q_rad" in result.stderr
    result = tolman("obstacle", "remove", "nobody", *place(stack))
    assert result.returncode == 1
    assert "nobody" in result.stderr


@pytest.mark.parametrize("owner", ["planner", "perception", "cameras", "robot"])
def test_a_killed_process_comes_back_by_itself(stack: OwnStack, bus: Bus, owner: str) -> None:
    before = info_of(bus, owner).pid
    os.kill(before, signal.SIGKILL)
    eventually(lambda: owner not in bus.alive_owners(), 10.0, f"the end of {owner}'s token")
    eventually(lambda: sorted(keys.OWNERS) == bus.alive_owners(), READY_WITHIN_S, f"{owner} to come back")
    assert info_of(bus, owner).pid != before
    result = tolman("goal", "--name", "home", "--wait", *place(stack))
    assert result.returncode == 0, result.stdout + result.stderr


def test_the_log_names_the_process_of_every_line(stack: OwnStack, bus: Bus) -> None:
    names = {"supervisor", "map", *keys.OWNERS}
    lines = stack.log_file.read_text(encoding="utf-8").splitlines()
    assert lines
    assert [line for line in lines if line.split()[1] not in names] == []


def test_up_and_down_leave_nothing_behind() -> None:
    before = set(Path("/dev/shm").glob("*.zenoh"))
    where = ["--connect", free_endpoint(), "--namespace", "updown"]
    up = tolman("up", "--detach", *where, timeout_s=READY_WITHIN_S)
    assert up.returncode == 0, up.stdout + up.stderr
    with Bus(BusAddress(where[1], "updown")) as bus:
        pids = [info_of(bus, owner).pid for owner in keys.OWNERS]
    again = tolman("up", "--detach", *where)
    assert "already up" in again.stdout
    down = tolman("down", *where)
    assert down.returncode == 0, down.stdout + down.stderr
    assert not any(Path(f"/proc/{pid}").exists() for pid in pids)
    assert RunDirectory(BusAddress(where[1], "updown")).running_pid() is None
    assert set(Path("/dev/shm").glob("*.zenoh")) <= before


def test_nobody_survives_a_killed_supervisor() -> None:
    before = set(Path("/dev/shm").glob("*.zenoh"))
    own = OwnStack(StackOptions(BusAddress(free_endpoint(), "killed")))
    try:
        with own.connect() as bus:
            eventually(lambda: "robot" in bus.alive_owners(), READY_WITHIN_S, "the robot")
            robot = info_of(bus, "robot").pid
        supervisor = RunDirectory(own.address).running_pid()
        assert supervisor is not None
        os.kill(supervisor, signal.SIGKILL)
        eventually(lambda: not Path(f"/proc/{robot}").exists(), 10.0, "the end of the robot")
    finally:
        own.stop()
    assert set(Path("/dev/shm").glob("*.zenoh")) <= before


def test_a_config_error_ends_the_start_with_its_place() -> None:
    where = ["--connect", free_endpoint(), "--namespace", "wrong"]
    result = tolman("up", "--detach", *where, "--set", "perception.min_pionts=3")
    assert result.returncode != 0
    assert "min_pionts" in result.stderr
    result = tolman("up", "--detach", *where, "--config", "no/such/file.toml")
    assert result.returncode != 0
    assert "no/such/file.toml" in result.stderr


def test_the_robot_state_is_there_for_late_joiners(bus: Bus) -> None:
    (state,) = bus.get_state("robot/state", RobotState)
    assert state.mode in ("idle", "tracking", "holding")
