"""The shell of the cameras: published state in, four simultaneous depth images out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from common import cell as cells
from common.bus.service import Service, Vitals
from common.bus.session import Bus
from common.clock import ClockOffset, monotonic_ns, utc_ns
from common.config import plain
from common.errors import RequestError
from common.robot.history import JointHistory, JointSample
from common.robot.model import RobotModel, load_robot
from common.robot.payload import Payload, payload_body
from common.wire import keys
from common.wire.messages import DepthImage, HeldBox, RobotState, Scene
from services.robot_sim.adapters.raycast import DepthRenderer
from services.robot_sim.cameras.config import CamerasConfig
from services.robot_sim.core.camera_exposure import MovingShape, SceneHistory, moving_shape
from services.robot_sim.core.camera_noise import DepthNoise
from services.robot_sim.core.camera_schedule import Schedule
from services.robot_sim.core.camera_shapes import PlacedShape

__all__ = ["CamerasService", "start"]


class CamerasService:
    """Exposes at fixed instants, renders once the state around the instant is known, publishes all images together."""

    def __init__(self, bus: Bus, cell: cells.CellConfig, config: CamerasConfig, vitals: Vitals) -> None:
        self._bus, self._cell, self._config, self._vitals = bus, cell, config, vitals
        self._models = config.models()
        self._states = bus.queue("robot/state", RobotState)
        self._scenes = bus.latest("robot/scene", Scene)
        self._publishers = [bus.publisher(keys.camera_depth(model.name), DepthImage) for model in self._models]
        self._clock = ClockOffset()
        self._noise = DepthNoise(config.noise_model(), config.seed)
        self._scene_history = SceneHistory(max_extrapolation_s=config.max_extrapolation_s)
        self._schedule = Schedule(config.rate_hz, config.render_delay_s)
        self._held: HeldBox | None = None
        self._robot: RobotModel
        self._joint_history: JointHistory
        self._renderer: DepthRenderer

    def warm_up(self) -> None:
        """Load the arm, build its scenes, compile the kernels by one image of each kind of solid."""
        self._robot = load_robot(self._cell.robot)
        self._joint_history = JointHistory(self._robot.n_joints)
        poses = self._robot.joint_poses(self._robot.home_rad[None])[0]
        self._renderer = DepthRenderer(self._models, self._robot.bodies, poses[0], self._cell.static)
        for image in self._renderer.render(poses, [PlacedShape("sphere", (0.1,), np.eye(4))]):
            self._noise.measure(image, self._models[0].fx_px, 0, 0)

    def step(self, now_ns: int) -> int | None:
        """Take what came in; expose if it is time."""
        self._take_states()
        self._take_scene()
        exposure = self._schedule.due(now_ns)
        if exposure is not None:
            self._expose(*exposure)
        self._vitals.counters["skipped_exposures"] = self._schedule.n_skipped
        return self._schedule.next_due_ns

    def close(self) -> None:
        """Nothing but the bus is held."""

    def fingerprints(self) -> dict[str, str]:
        """What the images rest on."""
        return {"robot": self._robot.fingerprint}

    def _take_states(self) -> None:
        for received in self._states.take_all():
            state = received.message
            problem = self._joint_history.add(JointSample(state.stamp_ns, state.q_rad, state.dq_rad_s, state.seq))
            problem = problem or self._hear_held(state.held)
            if problem:
                self._bus.complain(f"{received.key}: {problem}", subject=received.key)
            else:
                self._clock.observe(state.stamp_ns, received.arrival_ns)

    def _hear_held(self, box: HeldBox | None) -> str:
        """Show what the gripper holds; says what is wrong with it."""
        if box == self._held:
            return ""
        self._held = box
        try:
            body = None if box is None else payload_body(self._robot, Payload.of(box.size_m, box.position_m, box.quaternion_xyzw))
        except RequestError as error:
            return f"held: {error.message}"
        self._renderer.hold(body)
        return ""

    def _take_scene(self) -> None:
        received = self._scenes.take()
        if received is None:
            return
        shapes: list[MovingShape] = []
        for o in received.message.obstacles:
            shape = moving_shape(o.shape, o.size_m, o.position_m, o.quaternion_xyzw, o.velocity_m_s)
            if isinstance(shape, str):
                self._bus.complain(f"{received.key}: obstacle {o.id!r}: {shape}", subject=f"{received.key} {o.id}")
            else:
                shapes.append(shape)
        self._scene_history.add(received.message.stamp_ns, shapes)

    def _expose(self, exposure_ns: int, frame: int) -> None:
        sender_ns = self._clock.to_sender(exposure_ns) if self._joint_history.newest_ns is not None else 0
        arm = self._joint_history.at(sender_ns)
        shapes = self._scene_history.at(sender_ns)
        missing = [key for key, found in (("robot/state", arm), ("robot/scene", shapes)) if found is None]
        self._vitals.reasons[:] = [f"no {key} of the exposure" for key in missing]
        if arm is None or shapes is None:
            self._vitals.count("exposures_without_state")
            return
        started_ns = monotonic_ns()
        images = self._renderer.render(self._robot.joint_poses(arm.q_rad[None])[0], shapes)
        rendered_ns = monotonic_ns()
        measured = [self._noise.measure(image, self._models[i].fx_px, i, frame) for i, image in enumerate(images)]
        done_ns = monotonic_ns()
        self._publish(measured, exposure_ns + utc_ns() - monotonic_ns())
        self._vitals.meter("render").tick(done_ns, (rendered_ns - started_ns) / 1e6)
        self._vitals.meter("noise").tick(done_ns, (done_ns - rendered_ns) / 1e6)
        self._vitals.meter("exposure_to_published").tick(done_ns, (monotonic_ns() - exposure_ns) / 1e6)

    def _publish(self, depth_mm: list[NDArray[np.uint16]], stamp_ns: int) -> None:
        for model, publisher, image in zip(self._models, self._publishers, depth_mm, strict=True):
            message = DepthImage(
                camera=model.name,
                width=model.width,
                height=model.height,
                fx_px=model.fx_px,
                fy_px=model.fy_px,
                cx_px=model.cx_px,
                cy_px=model.cy_px,
                T_world_camera=model.T_world_camera,
                depth_mm=image,
                published_ns=utc_ns(),
            )
            publisher.publish(message, stamp_ns=stamp_ns)


def start(bus: Bus, config_path: Path | None, overrides: list[str], vitals: Vitals) -> tuple[Service, dict[str, Any]]:
    """The service of a config file, and that config as plain data."""
    cell, config = cells.load(config_path, "cameras", CamerasConfig, overrides)
    return CamerasService(bus, cell, config, vitals), {"cell": plain(cell), "cameras": plain(config)}
