"""Cameras and perception as real processes around a real router, with a robot that only says where it is."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack

import numpy as np
import pytest
from numpy.typing import NDArray

from clients.stack import free_endpoint
from common.bus.session import Bus, BusAddress, Router
from common.cell import GridConfig
from common.clock import utc_ns
from common.geometry.grid import Grid
from common.geometry.transforms import rpy_matrix
from common.wire.messages import DepthImage, Empty, Obstacle, ServiceHealth, ServiceInfo, VoxelFrame
from services.robot_sim.core.camera_shapes import PlacedShape
from tests.support.eventually import eventually
from tests.support.fake_robot import FakeRobot
from tests.support.truth import signed_distance_m

pytestmark = pytest.mark.integration

BOX = PlacedShape("box", (0.1, 0.12, 0.2), rpy_matrix([-0.45, 0.0, 0.3], [0.0, 0.0, 0.0]))
OBSTACLE = Obstacle(id="box", shape="box", size_m=list(BOX.size_m), position_m=[-0.45, 0.0, 0.3])
SHADOW_M = 0.10 + 0.0175 + 0.01  # depth of a shadow, half the diagonal of a cell, and depth noise at a metre
READY_WITHIN_S = 120.0  # the first start on a machine compiles kernels


def swing(seconds: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Base and shoulder swing at up to 1.5 rad/s, away from the box."""
    q = np.array([0.8 * np.sin(1.9 * seconds), -1.57 + 0.5 * np.sin(3.0 * seconds), 1.57, -1.57, -1.57, 0.0])
    dq = np.array([1.52 * np.cos(1.9 * seconds), 1.5 * np.cos(3.0 * seconds), 0.0, 0.0, 0.0, 0.0])
    return q, dq


class Cell:
    """The two processes under test, the robot, and a client that listens."""

    def __init__(self, endpoint: str) -> None:
        self.address = BusAddress(endpoint, "eyes")
        self.bus = Bus(self.address)
        self.robot_bus = Bus(self.address)
        self.robot = FakeRobot(self.robot_bus, swing)
        self.frames = self.bus.latest("perception/voxels", VoxelFrame)
        self.processes: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, owner: str) -> None:
        module = {"cameras": "services.robot_sim.cameras", "perception": "services.perception"}[owner]
        command = [sys.executable, "-m", module, "--connect", self.address.endpoint, "--namespace", self.address.namespace]
        self.processes[owner] = subprocess.Popen(command)

    def wait_alive(self, *owners: str) -> None:
        eventually(lambda: set(owners) <= set(self.bus.alive_owners()), READY_WITHIN_S, f"readiness of {owners}")

    def kill(self, owner: str) -> None:
        self.processes[owner].kill()
        self.processes.pop(owner).wait()

    def health(self, owner: str) -> ServiceHealth:
        return self.bus.request(f"{owner}/health", Empty(), ServiceHealth)

    def frame(self) -> VoxelFrame:
        """The next frame."""
        return eventually(self.frames.take, 10.0, "a voxel frame").message

    def close(self) -> None:
        self.robot.close()
        for process in self.processes.values():
            process.send_signal(signal.SIGINT)
        for process in self.processes.values():
            assert process.wait(timeout=10.0) == 0
        self.robot_bus.close()
        self.bus.close()


@pytest.fixture(scope="module")
def cell() -> Iterator[Cell]:
    with ExitStack() as stack:
        router = stack.enter_context(Router(free_endpoint()))
        cell = Cell(router.endpoint)
        stack.callback(cell.close)
        for owner in ("cameras", "perception"):
            cell.start(owner)
        cell.wait_alive("cameras", "perception")
        yield cell


def centres(frame: VoxelFrame) -> NDArray[np.float64]:
    """Cell centres as any client would find them, from what the frame says of its grid."""
    g = frame.grid
    grid = Grid.of(GridConfig(origin_m=tuple(g.origin_m), shape=list(g.shape), resolution_m=g.resolution_m))
    assert grid.fingerprint == g.fingerprint
    assert np.all(np.diff(frame.cells) > 0)
    return grid.centres(frame.cells)


def test_a_box_is_seen_and_the_moving_arm_is_not_and_what_is_gone_clears(cell: Cell) -> None:
    cell.robot.obstacles = [OBSTACLE]
    eventually(lambda: len(cell.frame().cells) > 100, 10.0, "the box in the cells")
    for _ in range(30):
        frame = cell.frame()
        assert np.abs(signed_distance_m(BOX, centres(frame))).max() < SHADOW_M, "a cell that is neither box nor its shadow"

    def whole() -> VoxelFrame | None:
        """A frame that all cameras were in time for; on a busy machine not each is."""
        frame = cell.frame()
        return frame if all(use.used for use in frame.cameras) else None

    frame = eventually(whole, 10.0, "a frame of all cameras")
    assert len({use.exposure_ns for use in frame.cameras}) == 1
    assert frame.stamp_ns == max(use.exposure_ns for use in frame.cameras)
    assert all(use.published_ns > use.exposure_ns for use in frame.cameras)
    assert {"project", "splat", "settle", "shadows", "total", "total_p50"} <= set(frame.timing_ms)
    cell.robot.obstacles = []
    eventually(lambda: len(cell.frame().cells) == 0, 5.0, "the box gone from the cells")


def test_late_joiners_get_the_last_image_and_frame(cell: Cell) -> None:
    cell.frame()
    (frame,) = cell.bus.get_state("perception/voxels", VoxelFrame)
    assert len(frame.cameras) == 4
    (image,) = cell.bus.get_state("camera/front_left/depth", DepthImage)
    assert image.depth_mm.shape == (240, 424)


def test_info_and_health_tell_config_rates_and_latencies(cell: Cell) -> None:
    cell.frame()
    info = cell.bus.request("perception/info", Empty(), ServiceInfo)
    assert info.config["perception"]["min_points"] == 3
    assert set(info.fingerprints) == {"robot", "grid"}
    eventually(lambda: cell.health("perception").ok and cell.health("cameras").ok, 10.0, "both healthy")
    assert cell.health("cameras").rates_hz["render"] > 5.0
    assert cell.health("perception").latency_ms["exposure_to_frame"]["p50"] > 0.0


def image(name: str, **change: object) -> DepthImage:
    T = np.diag([1.0, -1.0, -1.0, 1.0])
    T[2, 3] = 1.0
    fields = {
        "camera": name, "width": 64, "height": 48, "fx_px": 60.0, "fy_px": 60.0, "cx_px": 31.5, "cy_px": 23.5,
        "T_world_camera": T, "depth_mm": np.full((48, 64), 500, np.uint16), "published_ns": 0,
    }  # fmt: skip
    return DepthImage(**{**fields, **change})  # type: ignore[arg-type]


def test_garbage_on_every_key_is_counted_and_survived(cell: Cell) -> None:
    keys = ["camera/front_left/depth", "camera/nobody/depth", "robot/state", "robot/scene"]
    before = {owner: cell.health(owner).counters.get("bad_payloads", 0) for owner in ("cameras", "perception")}
    with Bus(cell.address) as rogue:
        for key in keys:
            for garbage in (b"", b"\xff\x00garbage", b"\x80", b"\x93\x01\x02\x03"):
                rogue.session.put(key, garbage)
        publisher = rogue.publisher("camera/nobody/depth", DepthImage)
        for change in ({"width": 63}, {"T_world_camera": np.full((4, 4), np.nan)}, {"fx_px": -1.0}, {"camera": "front_left"}):
            publisher.publish(image("nobody", **change))

            def counted(owner: str = "perception") -> bool:
                return cell.health(owner).counters.get("bad_payloads", 0) > before[owner]

            eventually(counted, 5.0, "the bad payload counted")
            before["perception"] = cell.health("perception").counters["bad_payloads"]
    eventually(lambda: cell.health("cameras").counters.get("bad_payloads", 0) > before["cameras"], 5.0, "garbage counted by the cameras")
    for _ in range(5):
        cell.frame()
    for owner in ("cameras", "perception"):
        assert cell.health(owner).counters.get("step_errors", 0) == 0
        assert cell.processes[owner].poll() is None


def test_obstacles_that_cannot_be_drawn_leave_the_others_alone(cell: Cell) -> None:
    broken = [
        Obstacle(id="nan", shape="sphere", size_m=[0.1], position_m=[float("nan"), 0.0, 0.0]),
        Obstacle(id="mesh", shape="mesh", size_m=[], position_m=[0.0, 0.0, 0.0], mesh="duck"),
    ]
    cell.robot.obstacles = [broken[0], OBSTACLE, broken[1]]
    eventually(lambda: len(cell.frame().cells) > 100, 10.0, "the sound box in the cells")
    cell.robot.obstacles = []
    eventually(lambda: len(cell.frame().cells) == 0, 5.0, "the box gone")


def test_the_cameras_die_and_come_back(cell: Cell) -> None:
    cell.frame()
    cell.kill("cameras")
    reasons = eventually(lambda: cell.health("perception").reasons, 5.0, "perception says what it lacks")
    assert any("camera front_left: no exposure" in reason for reason in reasons)
    cell.start("cameras")
    cell.wait_alive("cameras")
    eventually(lambda: all(use.used for use in cell.frame().cameras), 10.0, "frames with all cameras again")
    eventually(lambda: cell.health("perception").ok, 5.0, "perception is content again")


def test_perception_dies_and_comes_back(cell: Cell) -> None:
    before = cell.frame()
    cell.kill("perception")
    cell.start("perception")
    cell.wait_alive("perception")
    eventually(lambda: cell.frame().epoch > before.epoch, 10.0, "frames of a new epoch")


def test_one_camera_of_a_clients_own_is_fused_and_the_others_are_said_to_be_missing(cell: Cell) -> None:
    """Last of its kind: the simulated cameras are gone, somebody feeds their own."""
    cell.kill("cameras")
    with Bus(cell.address) as own:
        publisher = own.publisher("camera/front_left/depth", DepthImage)

        def fed() -> VoxelFrame | None:
            newest = cell.frames.take()
            alone = newest is not None and [use.name for use in newest.message.cameras if use.used] == ["front_left"]
            if newest is not None and alone and len(centres(newest.message)):  # cells wait for a second look: the first frame has none
                return newest.message
            publisher.publish(image("front_left", published_ns=utc_ns()))
            return None

        frame = eventually(fed, 10.0, "a frame from one camera")
    assert [use.used for use in frame.cameras] == [True, False, False, False]
    assert np.abs(centres(frame)[:, 2] - 0.45).max() < 0.11  # the wall at 0.5 m height and its shadow below
    cell.start("cameras")
    cell.wait_alive("cameras")
