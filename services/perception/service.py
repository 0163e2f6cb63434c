"""The shell of perception: depth images and joint states in, one voxel frame a set of exposures out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from common import cell as cells
from common.bus.channels import Received
from common.bus.service import Service, Vitals
from common.bus.session import Bus
from common.clock import ClockOffset, monotonic_ns
from common.config import plain
from common.errors import ConfigError, RequestError
from common.geometry.grid import Grid
from common.geometry.transforms import invert
from common.log import RateLimit
from common.robot.history import JointHistory, JointSample
from common.robot.model import RobotModel, load_robot
from common.robot.payload import Payload, with_payload_grids
from common.wire.messages import CameraUse, DepthImage, GridInfo, HeldBox, RobotState, VoxelFrame
from services.perception.adapters.back_projection import back_project
from services.perception.config import PerceptionConfig
from services.perception.core.arm import arm_at, margins_of
from services.perception.core.background import background_of
from services.perception.core.camera_view import CameraView, Optics, problem_of_exposure, sigma_per_m2
from services.perception.core.exposure_sets import ExposureSets, TimedExposure
from services.perception.core.occupancy import Exposure, Occupancy

__all__ = ["PerceptionService", "start"]

I32 = NDArray[np.int32]


class PerceptionService:
    """Waits for simultaneous exposures, fuses them, publishes at once."""

    def __init__(self, bus: Bus, cell: cells.CellConfig, config: PerceptionConfig, vitals: Vitals) -> None:
        self._bus, self._cell, self._config, self._vitals = bus, cell, config, vitals
        self._grid = Grid.of(cell.grid)
        self._images = bus.latest("camera/*/depth", DepthImage)
        self._states = bus.queue("robot/state", RobotState)
        self._frames = bus.publisher("perception/voxels", VoxelFrame)
        self._robot_clock = ClockOffset()
        self._camera_clocks: dict[str, tuple[int, ClockOffset]] = {}  # epoch of the camera, its clock
        self._uses = {name: CameraUse(name=name, seq=0, exposure_ns=0, used=False) for name in config.cameras}
        self._seen_ns = dict.fromkeys(config.cameras, 0)
        self._sets: ExposureSets[DepthImage] = ExposureSets(
            config.cameras, tolerance_s=config.set_tolerance_s, deadline_s=config.set_deadline_s, max_age_s=config.max_age_s
        )
        self._limit = RateLimit()
        self._robot: RobotModel
        self._bare: RobotModel
        self._held: HeldBox | None = None
        self._history: JointHistory
        self._occupancy: Occupancy
        self._margin_m: NDArray[np.float64]
        self._state_was_missing = False

    def warm_up(self) -> None:
        """Load the arm, build the background, compile every kernel by one set of a blank and a busy image."""
        self._robot = self._bare = load_robot(self._cell.robot)
        self._history = JointHistory(self._robot.n_joints)
        margin = margins_of([b.name for b in self._robot.bodies], self._config.self_margin_m, self._config.self_margin_of_body_m)
        if isinstance(margin, str):
            raise ConfigError(f"perception.self_margin_of_body_m: {margin}")
        self._margin_m = margin
        self._forget()
        with_payload_grids(self._bare, Payload((0.04, 0.04, 0.04)))  # compiles what it needs
        camera = self._config.cameras[0]
        T = np.diag([1.0, -1.0, -1.0, 1.0])  # looks down from above the middle of the table
        T[2, 3] = self._cell.table_z_m + 1.0
        for depth in (300, 950):
            image = DepthImage(
                camera=camera, width=64, height=48, fx_px=60.0, fy_px=60.0, cx_px=31.5, cy_px=23.5, T_world_camera=T,
                depth_mm=np.full((48, 64), depth, dtype=np.uint16), published_ns=0,
            )  # fmt: skip
            arm = JointSample(0, self._robot.home_rad, np.zeros(self._robot.n_joints), 0)
            self._fuse([self._exposure(image, arm)], 0.0, {})
        self._forget()

    def step(self, now_ns: int) -> int | None:
        """Take what came in; fuse and publish a set that is due."""
        self._take_states()
        for received in self._images.take_all():
            self._take_image(received, now_ns)
        ready = self._sets.take(monotonic_ns())
        if ready is not None:
            self._publish(ready)
        self._vitals.counters["sets_skipped"] = self._sets.n_skipped
        self._report(now_ns)
        return self._sets.next_deadline_ns

    def close(self) -> None:
        """Nothing but the bus is held."""

    def fingerprints(self) -> dict[str, str]:
        """What the cells rest on."""
        return {"robot": self._robot.fingerprint, "grid": self._grid.fingerprint}

    def _forget(self) -> None:
        config, cell = self._config, self._cell
        background = background_of(self._grid, cell.table_z_m, cell.static, config.sigmas, config.plane_sigmas)
        self._occupancy = Occupancy(self._grid, background, self._robot.grids, config.rules())

    # --- what comes in ---

    def _take_states(self) -> None:
        for received in self._states.take_all():
            state = received.message
            problem = self._history.add(JointSample(state.stamp_ns, state.q_rad, state.dq_rad_s, state.seq)) or self._hear_held(state.held)
            if problem:
                self._bus.complain(f"{received.key}: {problem}", subject=received.key)
            else:
                self._robot_clock.observe(state.stamp_ns, received.arrival_ns)

    def _hear_held(self, box: HeldBox | None) -> str:
        """What the gripper holds is the arm, and no cell; says what is wrong with it."""
        if box == self._held:
            return ""
        self._held = box
        try:
            payload = None if box is None else Payload.of(box.size_m, box.position_m, box.quaternion_xyzw)
        except RequestError as error:
            return f"held: {error.message}"
        held = self._bare if payload is None else with_payload_grids(self._bare, payload)
        n = len(self._bare.bodies)
        extra = np.full(len(held.bodies) - n, self._config.self_margin_m)
        self._robot, self._margin_m = held, np.concatenate([self._margin_m[:n], extra])
        self._occupancy.rearm(held.grids)
        return ""

    def _take_image(self, received: Received[DepthImage], now_ns: int) -> None:
        m = received.message
        problem = problem_of_exposure(m.width, m.height, m.fx_px, m.fy_px, m.cx_px, m.cy_px, m.T_world_camera, m.depth_mm)
        if received.key != f"camera/{m.camera}/depth":
            problem = f"says that it is of camera {m.camera!r}"
        if problem:
            self._bus.complain(f"{received.key}: {problem}", subject=received.key)
            return
        clock = self._clock_of(m)
        clock.observe(m.published_ns, received.arrival_ns)
        refusal = self._sets.add(TimedExposure(m.camera, clock.to_monotonic(m.stamp_ns), m), now_ns)
        if refusal is not None:
            self._vitals.count(f"exposures_{refusal}")
        if refusal in {None, "too_late"}:
            self._seen_ns[m.camera] = received.arrival_ns
            self._uses[m.camera] = self._use(m, used=False)

    def _clock_of(self, image: DepthImage) -> ClockOffset:
        known = self._camera_clocks.get(image.camera)
        if known is not None and known[0] == image.epoch:
            return known[1]
        if known is not None:
            self._sets.restart()
        if known is None and len(self._camera_clocks) >= 64:  # names come from outside; our choice
            self._camera_clocks.clear()
        clock = ClockOffset()
        self._camera_clocks[image.camera] = (image.epoch, clock)
        return clock

    # --- what goes out ---

    def _publish(self, ready: list[TimedExposure[DepthImage]]) -> None:
        started_ns = monotonic_ns()
        images = [e.payload for e in ready]
        newest_ns = max(e.exposure_ns for e in ready)
        samples = (
            [self._history.at(self._robot_clock.to_sender(e.exposure_ns)) for e in ready] if self._history.newest_ns is not None else []
        )
        self._state_was_missing = not samples or any(s is None for s in samples)
        if self._state_was_missing:
            self._vitals.count("sets_without_robot_state")
            return
        arms = [s for s in samples if s is not None]
        timing: dict[str, float] = {}
        exposures = [self._exposure(image, arm) for image, arm in zip(images, arms, strict=True)]
        timing["project"] = (monotonic_ns() - started_ns) / 1e6
        cells_now = self._fuse(exposures, newest_ns * 1e-9, timing)
        done_ns = monotonic_ns()
        timing["total"] = (done_ns - started_ns) / 1e6
        meter = self._vitals.meter("fuse")
        meter.tick(done_ns, timing["total"])
        timing["total_p50"] = (meter.percentiles_ms() or {"p50": 0.0})["p50"]
        timing["exposure_to_frame"] = (done_ns - newest_ns) / 1e6
        self._vitals.meter("exposure_to_frame").tick(done_ns, timing["exposure_to_frame"])
        uses = {**self._uses, **{image.camera: self._use(image, used=True) for image in images}}
        frame = VoxelFrame(
            grid=GridInfo(
                origin_m=list(self._grid.origin_m),
                shape=list(self._grid.shape),
                resolution_m=self._grid.resolution_m,
                fingerprint=self._grid.fingerprint,
            ),
            cells=cells_now,
            cameras=list(uses.values()),
            robot_seq=max(arm.seq for arm in arms),
            timing_ms=timing,
        )
        self._frames.publish(frame, stamp_ns=max(image.stamp_ns for image in images))

    def _exposure(self, image: DepthImage, arm: JointSample) -> Exposure:
        config, T = self._config, image.T_world_camera
        index = config.cameras.index(image.camera)
        depth_mm = np.array(image.depth_mm)  # what was received is read-only, which Open3D and the kernels do not take
        sigma = sigma_per_m2(config.disparity_sigma_px, image.fx_px, config.baseline_m)
        optics = Optics(image.fx_px, image.fy_px, image.cx_px, image.cy_px, sigma, config.min_range_m)
        view = CameraView(optics, np.ascontiguousarray(T[:3, :3]), np.ascontiguousarray(T[:3, 3]), 1 << index, depth_mm)
        points = back_project(depth_mm, image.fx_px, image.fy_px, image.cx_px, image.cy_px, invert(T), config.max_range_m)
        return Exposure(index, view, points, arm_at(self._robot.chain, self._robot.grids, arm.q_rad, self._margin_m, config.sigmas))

    def _fuse(self, exposures: list[Exposure], now_s: float, timing_ms: dict[str, float]) -> I32:
        stamps = [monotonic_ns()]
        self._occupancy.begin()
        for exposure in exposures:
            self._occupancy.splat(exposure)
        stamps.append(monotonic_ns())
        self._occupancy.settle(exposures, now_s)
        stamps.append(monotonic_ns())
        occupied = self._occupancy.cells(self._occupancy.shadows(exposures))
        stamps.append(monotonic_ns())
        for name, a, b in zip(("splat", "settle", "shadows"), stamps[:-1], stamps[1:], strict=True):
            timing_ms[name] = (b - a) / 1e6
        return occupied

    def _use(self, image: DepthImage, *, used: bool) -> CameraUse:
        return CameraUse(name=image.camera, seq=image.seq, exposure_ns=image.stamp_ns, used=used, published_ns=image.published_ns)

    def _report(self, now_ns: int) -> None:
        limit_ns = self._config.missing_after_s * 1e9
        reasons = [
            f"camera {name}: no exposure for {self._config.missing_after_s:g} s"
            for name, t in self._seen_ns.items()
            if now_ns - t > limit_ns
        ]
        if self._state_was_missing:
            reasons.append("no robot/state of the exposure")
        self._vitals.reasons[:] = reasons


def start(bus: Bus, config_path: Path | None, overrides: list[str], vitals: Vitals) -> tuple[Service, dict[str, Any]]:
    """The service of a config file, and that config as plain data."""
    cell, config = cells.load(config_path, "perception", PerceptionConfig, overrides)
    return PerceptionService(bus, cell, config, vitals), {"cell": plain(cell), "perception": plain(config)}
