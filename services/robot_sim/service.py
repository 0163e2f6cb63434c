"""The robot_sim service: inboxes -> executor, obstacles, physics -> robot/state and robot/scene. No rule lives here."""

from __future__ import annotations

import logging
from collections import deque
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from common.bus.service import Vitals
from common.bus.session import Bus
from common.cell import CellConfig
from common.clock import ClockOffset, monotonic_ns, utc_ns
from common.errors import RequestError
from common.log import RateLimit
from common.robot.braking import brake_along
from common.robot.model import load_robot
from common.robot.payload import PAYLOAD, Payload, with_payload_shape
from common.robot.rates import largest_rates
from common.robot.trajectory import JointTrajectory
from common.wire.messages import (
    Ack,
    Clearance,
    Empty,
    Grasp,
    Guide,
    GuideReply,
    HeldBox,
    PlannerStatus,
    RobotState,
    Scene,
    SetObstacle,
    Trajectory,
    VoxelFrame,
)
from services.robot_sim.adapters.bullet import World
from services.robot_sim.adapters.bullet_monitor import Monitor
from services.robot_sim.config import RobotSimConfig
from services.robot_sim.core.admission import Motion
from services.robot_sim.core.contacts import Contact
from services.robot_sim.core.executor import Cause, Executor
from services.robot_sim.core.guiding import guided_curve
from services.robot_sim.core.hand import HandPoint
from services.robot_sim.core.limits import Limits
from services.robot_sim.core.obstacles import Manners, Obstacles, Thing
from services.robot_sim.core.pacer import Pacer
from services.robot_sim.core.scripts import Pose
from services.robot_sim.core.watchdog import Watchdog
from services.robot_sim.translate import clearance_message, exposure_instant_ns, hand_points, motion_of, obstacle_message, set_obstacle

__all__ = ["RobotSim"]

F64 = NDArray[np.float64]
log = logging.getLogger("robot")


class RobotSim:
    """The simulated cell: drives what the planner sends, moves the obstacles, tells the truth about both."""

    def __init__(self, bus: Bus, cell: CellConfig, config: RobotSimConfig, vitals: Vitals) -> None:
        self._bus = bus
        self._cell = cell
        self._config = config
        self._vitals = vitals
        self._limit = RateLimit()
        self._watchdog = Watchdog(config.watchdog_limits)
        self._planner_clock, self._cameras_clock = ClockOffset(), ClockOffset()
        self._alive_changes: deque[tuple[str, bool]] = deque()
        self._accepted_ns = 0
        self._n_guides = 0
        self._held: HeldBox | None = None
        self._world: World | None = None

    def warm_up(self) -> None:
        """Load the arm, build the world, then open the inboxes."""
        self._robot = robot = load_robot(self._cell.robot)
        self._world = World(robot, self._cell.static, 1.0 / (self._config.control_hz * self._config.physics_substeps))
        self._monitor = Monitor(self._world, self._config)
        names = [*(solid.name for solid in self._cell.static), *(body.name for body in robot.bodies), PAYLOAD]
        self._obstacles = Obstacles(self._config.max_obstacles, names)
        limits = Limits(robot.position_min_rad, robot.position_max_rad, robot.max_velocity_rad_s, robot.max_acceleration_rad_s2)
        now_ns = monotonic_ns()
        still = JointTrajectory(np.array([0.0, 1.0]), np.stack([robot.home_rad] * 2), np.zeros((2, robot.n_joints)))
        largest_rates(still)  # compiles the kernels that admit and brake, before the first cycle counts
        brake_along(still, robot.max_acceleration_rad_s2)
        guided_curve(
            robot, robot.home_rad, [HandPoint(robot.tool_pose(robot.home_rad)[:3, 3].tolist(), None, 0.1, 0.0)], self._config.guide
        )
        self._executor = Executor(limits, self._config.executor, robot.home_rad, now_ns)
        self._pacer = Pacer(self._config.control_hz, now_ns)
        self._next_scene_ns = now_ns
        self._scene_changed = True
        self._is_told_to_stand = True
        self._open_inboxes()

    def _open_inboxes(self) -> None:
        bus = self._bus
        self._states = bus.publisher("robot/state", RobotState)
        self._scenes = bus.publisher("robot/scene", Scene)
        self._trajectories = bus.queue("planner/trajectory", Trajectory)
        self._statuses = bus.latest("planner/status", PlannerStatus)
        self._frames = bus.latest("perception/voxels", VoxelFrame)
        self._obstacle_commands = bus.commands("robot/obstacle", SetObstacle)
        self._guides = bus.commands("robot/guide", Guide)
        self._grasps = bus.commands("robot/grasp", Grasp)
        self._plain_commands = {
            noun: (bus.commands(f"robot/{noun}", Empty), action)
            for noun, action in (("stop", self._stop), ("resume", self._resume), ("reset", self._reset), ("clearance", self._clearance))
        }
        bus.watch_alive(lambda owner, alive: self._alive_changes.append((owner, alive)))

    def fingerprints(self) -> dict[str, str]:
        """For ``robot/info``."""
        return {"robot": self._robot.fingerprint}

    def close(self) -> None:
        """End the physics client."""
        if self._world is not None:
            self._world.close()

    def step(self, now_ns: int) -> int | None:
        """Listen, run the cycles that are due, answer."""
        lost = self._listen(now_ns)
        due = self._pacer.due(now_ns)
        if due.skipped_ns:
            self._executor.later(due.skipped_ns)
            self._vitals.count("skipped_ms", due.skipped_ns // 1_000_000)
        self._vitals.count("slipped_steps", due.slipped)
        for _ in range(due.cycles):
            self._cycle(self._pacer.advance(), lost)
        self._answer()
        if self._scene_changed or now_ns >= self._next_scene_ns:
            self._publish_scene(now_ns)
        return self._pacer.deadline_ns

    # --- what comes in ---

    def _listen(self, now_ns: int) -> str:
        while self._alive_changes:
            self._watchdog.set_alive(*self._alive_changes.popleft())
        status = self._statuses.take()
        if status is not None:
            self._planner_clock.observe(status.message.stamp_ns, status.arrival_ns)
            self._watchdog.heard_status(status.arrival_ns)
        frame = self._frames.take()
        if frame is not None:
            exposure_ns = exposure_instant_ns(frame.message, self._cameras_clock, frame.arrival_ns)
            if exposure_ns is not None:
                self._watchdog.saw_exposure(exposure_ns)
        for received in self._trajectories.take_all():
            self._submit(received.message, received.arrival_ns)
        return self._watchdog.lost(now_ns) if self._config.watchdog else ""

    def _submit(self, message: Trajectory, arrival_ns: int) -> None:
        motion = motion_of(message, self._planner_clock, arrival_ns)
        if message.kind == "motion" and message.held != self._held:  # sent before its sender heard what the gripper holds
            refusal: str | None = self._executor.refuse(message.id, "it does not reckon with what the gripper holds")
        else:
            refusal = self._executor.submit(motion)
        if refusal is None:
            self._accepted_ns = utc_ns()
            self._vitals.count("trajectories_accepted")
            return
        self._vitals.count("trajectories_refused")
        times = self._limit.allow("refused", arrival_ns)
        if times:
            log.warning("trajectory %.64r refused (%d since last report): %s", message.id, times, refusal)

    # --- the world goes on ---

    def _cycle(self, at_ns: int, lost: str) -> None:
        """One control cycle that ends at ``at_ns``."""
        assert self._world is not None
        began_ns = monotonic_ns()
        before = self._executor.status().mode
        self._executor.tick(at_ns, lost)
        self._move_obstacles()
        q_reference, dq_reference = self._drive(at_ns)
        q, dq = self._world.joints()
        # As told, not as measured: an arm that is being pushed stands all the same, and nobody goes on pushing it.
        self._is_told_to_stand = bool(np.abs(dq_reference).max() < self._config.standing_rad_s)
        for contact in self._monitor.after_cycle(at_ns, q, q_reference, dq_reference):
            self._tell_contact(contact)
        error = float(np.abs(q - q_reference).max())
        if error > self._config.tracking_fault_rad and before != "fault":
            self._executor.stop(f"the arm is {error:.3f} rad away from its reference: it is jammed", Cause.FAULT)
        self._publish_state(at_ns, q, dq, q_reference, dq_reference)
        self._vitals.meter("cycle").tick(at_ns, (monotonic_ns() - began_ns) / 1e6)

    def _tell_contact(self, contact: Contact) -> None:
        touch, status = contact.touch, self._executor.status()
        how = "caused" if contact.is_caused else "suffered"
        where = f"{status.mode}, {status.trajectory_id or 'no trajectory'} at {status.trajectory_time_s:.3f} s"
        log.warning("contact %s: %s touches %s, approaching at %.3f m/s (%s)", how, touch.part, touch.other, touch.approach_m_s, where)

    def _drive(self, at_ns: int) -> tuple[F64, F64]:
        assert self._world is not None
        n = self._config.physics_substeps
        instants = [at_ns - self._pacer.period_ns + round(k * self._pacer.period_ns / n) for k in range(n)] + [at_ns]
        references = [self._executor.reference(instant) for instant in instants]
        for (q_from, _), (q_to, _) in pairwise(references):
            self._world.step(q_from, q_to)
        return references[-1]

    def _move_obstacles(self) -> None:
        assert self._world is not None
        dt_s = self._pacer.period_ns / 1e9
        manners = Manners(self._config.politeness_gap_m, self._config.politeness_room_m)
        for thing in self._obstacles.step(dt_s, self._gap_m, manners, self._is_told_to_stand):
            self._world.place(thing.id, thing.pose)

    def _gap_m(self, thing: Thing, pose: Pose) -> float:
        assert self._world is not None
        return self._world.gap_m(thing.id, pose, self._config.politeness_room_m)

    def _publish_state(self, at_ns: int, q: F64, dq: F64, q_reference: F64, dq_reference: F64) -> None:
        status = self._executor.status()
        self._vitals.reasons = [status.reason] if status.reason and status.mode in ("fault", "holding", "stopping") else []
        self._states.publish(
            RobotState(
                q_rad=q,
                dq_rad_s=dq,
                q_reference_rad=q_reference,
                mode=status.mode,
                reason=status.reason,
                trajectory_id=status.trajectory_id,
                trajectory_time_s=status.trajectory_time_s,
                trajectory_accepted_ns=self._accepted_ns,
                trajectory_refused_id=status.refused_id,
                dq_reference_rad_s=dq_reference,
                held=self._held,
            ),
            stamp_ns=utc_ns() - (monotonic_ns() - at_ns),
        )

    def _publish_scene(self, now_ns: int) -> None:
        self._next_scene_ns = now_ns + round(1e9 / self._config.scene_hz)
        self._scene_changed = False
        self._scenes.publish(Scene(obstacles=[obstacle_message(thing) for thing in self._obstacles.all()]))

    # --- commands ---

    def _answer(self) -> None:
        assert self._world is not None
        for command in self._obstacle_commands.take_all():
            try:
                set_obstacle(command.request, self._obstacles, self._world)
            except RequestError as error:
                command.fail(error)
                continue
            self._scene_changed = True
            command.reply(Ack())
        for guide in self._guides.take_all():
            try:
                guide.reply(self._release() if guide.request.op == "release" else self._guide(guide.request))
            except RequestError as error:
                guide.fail(error)
        for grasp in self._grasps.take_all():
            try:
                grasp.reply(self._grasp(grasp.request))
            except RequestError as error:
                grasp.fail(error)
        for commands, action in self._plain_commands.values():
            for plain in commands.take_all():
                plain.reply(action())

    def _grasp(self, request: Grasp) -> Ack:
        """The gripper holds a box from now on, or nothing; all others hear it from ``robot/state``."""
        assert self._world is not None
        box = request.box
        if (request.op == "grasp") != (box is not None):
            raise RequestError(f"op {request.op!r}: a box is needed to grasp, and none to release", code="bad_grasp")
        robot = self._robot
        if box is not None:
            robot = with_payload_shape(robot, Payload.of(box.size_m, box.position_m, box.quaternion_xyzw))
        if box == self._held:
            return Ack()
        if self._executor.moving:
            raise RequestError("the arm is moving: it grasps and releases at rest only", code="moving")
        self._world.change_arm(robot, self._world.joints()[0])
        self._held = box
        return Ack()

    def _guide(self, request: Guide) -> GuideReply:
        """A hand takes the tool: the follower's curve is driven like any other."""
        self._n_guides += 1
        guide_id = f"guide-{self._bus.epoch:x}-{self._n_guides}"
        now_ns = self._pacer.deadline_ns
        if self._executor.moving:
            raise RequestError("the arm is moving: it is guided from rest only", code="moving")
        curve = guided_curve(self._robot, self._executor.reference(now_ns)[0], hand_points(request), self._config.guide)
        refusal = self._executor.guide(Motion(guide_id, "motion", now_ns, curve.t_s, curve.q_rad, curve.dq_rad_s))
        if refusal is not None:
            raise RequestError(f"not guided: {refusal}", code="refused")
        self._accepted_ns = utc_ns()
        return GuideReply(guide_id=guide_id, duration_s=curve.duration_s)

    def _release(self) -> GuideReply:
        guided = self._executor.guided
        self._executor.release()
        status = self._executor.status()
        return GuideReply(guide_id=status.trajectory_id if guided else "", duration_s=status.trajectory_time_s if guided else 0.0)

    def _stop(self) -> Ack:
        self._executor.stop("stopped by robot/stop")
        return Ack()

    def _resume(self) -> Ack:
        self._executor.resume()
        return Ack()

    def _reset(self) -> Ack:
        """The arm stands at home again, all counts begin anew; obstacles stay (``robot/obstacle`` clear removes them)."""
        assert self._world is not None
        self._world.reset(self._robot.home_rad)
        self._executor.reset(self._robot.home_rad, self._pacer.deadline_ns - self._pacer.period_ns)
        self._monitor.reset()
        return Ack()

    def _clearance(self) -> Clearance:
        return clearance_message(self._monitor)
