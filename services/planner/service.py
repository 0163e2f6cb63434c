"""The planner service: inboxes -> reflex -> trajectories, status, events; questions to a thread of their own. No rule lives here."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from common.bus.service import Vitals
from common.bus.session import Bus
from common.cell import CellConfig
from common.clock import ClockOffset, monotonic_ns, utc_ns
from common.errors import RequestError
from common.robot.payload import Payload
from common.wire.messages import (
    Ack,
    CancelGoal,
    Demonstration,
    GoalAccepted,
    HeldBox,
    MapQuery,
    PlannerEvent,
    PlannerStatus,
    PlanRequest,
    RobotState,
    SetGoal,
    Trajectory,
    VoxelFrame,
)
from services.planner.answering import QUESTIONS_WAITING, QuestionWorker, reply_to
from services.planner.assemble import assemble
from services.planner.carrier import Carrier
from services.planner.config import PlannerConfig
from services.planner.core.reflex import Reflex
from services.planner.core.report import Event, Goal
from services.planner.core.underway import ArmState, Sent
from services.planner.fallback.courier import Courier
from services.planner.fallback.process import FallbackProcess
from services.planner.inspection import map_reply
from services.planner.learner import Learner, Lesson, Student
from services.planner.memory import recall
from services.planner.questions import QuestionDesk, box_of, branches_of
from services.planner.rehearsal import rehearse, rehearse_holding, rehearse_learning

__all__ = ["Planner"]

log = logging.getLogger("planner")
STATUS_NS = 100_000_000  # PROTOCOL: 10 Hz and on change
STEP_NS = 20_000_000  # our choice: rules that depend on time alone are looked at so often
EVENTS_KEPT = 200  # PROTOCOL
NS = 1e9
# How long another thread may keep the interpreter from the loop: Python's 5 ms would be a third of a frame's answer. Our choice.
SWITCH_S = 0.0005


class Planner:
    """The shell around :class:`~services.planner.core.reflex.Reflex`."""

    def __init__(self, bus: Bus, cell: CellConfig, config: PlannerConfig, vitals: Vitals) -> None:
        self._bus = bus
        self._cell = cell
        self._config = config
        self._vitals = vitals
        self._robot_clock, self._frame_clock = ClockOffset(), ClockOffset()
        self._n_goals = 0
        self._n_events = 0
        self._next_status_ns = 0
        self._last_state = ""
        self._q_now: NDArray[np.float64] | None = None
        self._wrong_grid = False

    def warm_up(self) -> None:
        """Load robot and map, compile the kernels in a rehearsal, then open the inboxes."""
        self._memory = recall(assemble(self._cell, self._config, _log_progress()))
        if self._memory.complaint:
            log.error("what was learned is left out: %s", self._memory.complaint)
        self._parts = self._bare = self._memory.parts  # as it is planned with now, and without what is held
        self._resolver = self._parts.goal_resolver()
        self._reflex: Reflex = self._parts.reflex(monotonic_ns, f"{self._bus.epoch:x}")
        self._fallback = FallbackProcess(self._cell, self._config.margins) if "fallback" in self._config.ways else None
        sampler = None if self._fallback is None else self._fallback.sampler(None)
        self._courier = Courier(self._fallback, self._bus.wake.set) if self._fallback is not None else None
        rehearse(self._parts, monotonic_ns)
        student = Student(self._memory, self._reflex, sampler)
        rehearse_learning(student, self._parts)
        rehearse_holding(self._parts)
        sys.setswitchinterval(SWITCH_S)
        self._learner = Learner(student, self._config.learning.max_waiting, self._bus.wake.set)
        self._questions = QuestionWorker(QuestionDesk(self._parts, monotonic_ns, sampler), self._vitals, self._learn_way)
        self._carrier = Carrier(self._reflex, self._bus.wake.set, None if self._fallback is None else self._fallback.sampler)
        self._heard_box: HeldBox | None = None
        self._held: Payload | None = None
        self._open_inboxes()

    def _open_inboxes(self) -> None:
        bus = self._bus
        self._states = bus.latest("robot/state", RobotState)
        self._frames = bus.latest("perception/voxels", VoxelFrame)
        self._trajectories = bus.publisher("planner/trajectory", Trajectory)
        self._statuses = bus.publisher("planner/status", PlannerStatus)
        self._events = bus.publisher("planner/event", PlannerEvent, history=EVENTS_KEPT)
        self._goals = bus.commands("planner/goal", SetGoal)
        self._cancels = bus.commands("planner/cancel", CancelGoal)
        self._plans = bus.commands("planner/plan", PlanRequest)
        self._learns = bus.commands("planner/learn", Demonstration)
        self._maps = bus.commands("planner/map", MapQuery)

    def fingerprints(self) -> dict[str, str]:
        """For ``planner/info``."""
        return self._parts.fingerprints

    def close(self) -> None:
        """End the fallback's process and the threads of questions, lessons and what is held."""
        for name in ("_fallback", "_questions", "_learner", "_carrier"):  # a question may wait for the fallback: that ends first
            if getattr(self, name, None) is not None:
                getattr(self, name).close()

    def step(self, now_ns: int) -> int | None:
        """Listen, let the reflex act, send, answer."""
        self._listen(now_ns)
        if self._courier is not None:
            self._courier.bring(self._reflex.thinker)
        if now_ns >= self._next_status_ns:  # before the work: a long answer must not make the arm believe that we are gone
            self._publish_status(now_ns)
        sent, events = self._reflex.step(now_ns / NS)
        for trajectory in sent:
            self._send(trajectory, now_ns)
        for event in events:
            self._publish_event(event)
        if self._courier is not None:
            self._courier.fetch(self._reflex.thinker)
        self._answer()
        self._adopt_learned()
        self._adopt_held()
        if self._reflex.report.state != self._last_state or sent:
            self._publish_status(monotonic_ns())
        return now_ns if self._reflex.thinker.wants_steps else now_ns + STEP_NS

    # --- in ---

    def _listen(self, now_ns: int) -> None:
        state = self._states.take()
        if state is not None:
            message = state.message
            self._robot_clock.observe(message.stamp_ns, state.arrival_ns)
            self._q_now = message.q_reference_rad
            self._hear_held(message.held)
            self._reflex.hear(
                ArmState(
                    at_s=self._robot_clock.to_monotonic(message.stamp_ns) / NS,
                    q_reference_rad=message.q_reference_rad,
                    dq_reference_rad_s=message.dq_rad_s if message.dq_reference_rad_s is None else message.dq_reference_rad_s,
                    standing=message.mode not in ("tracking", "stopping"),
                    mode=message.mode,
                    reason=message.reason,
                    trajectory_id=message.trajectory_id,
                    trajectory_time_s=message.trajectory_time_s,
                    accepted_utc_ns=message.trajectory_accepted_ns,
                    refused_id=message.trajectory_refused_id,
                ),
                now_ns / NS,
            )
        frame = self._frames.take()
        if frame is not None:
            self._see(frame.message, frame.arrival_ns, now_ns)

    def _hear_held(self, box: HeldBox | None) -> None:
        """What the gripper holds has changed: the arm stands until the planner is ready for it."""
        if box == self._heard_box:
            return
        self._heard_box = box
        try:
            self._held = None if box is None else Payload.of(box.size_m, box.position_m, box.quaternion_xyzw)
        except RequestError as error:
            self._reflex.waiting = f"robot/state.held: {error.message}"
            return
        self._reflex.waiting = "the planner gets ready for what the gripper holds"
        self._carrier.want(self._bare, self._held)

    def _see(self, frame: VoxelFrame, arrival_ns: int, now_ns: int) -> None:
        self._wrong_grid = frame.grid.fingerprint != self._parts.grid.fingerprint
        if self._wrong_grid:
            self._vitals.count("foreign_frames")
            return
        used = [camera for camera in frame.cameras if camera.used]
        published = [camera.published_ns for camera in used if camera.published_ns]
        # The stamp to learn the clock from is the latest one made before sending; the frame's own stamp is an exposure.
        self._frame_clock.observe(max([frame.stamp_ns, *published]), arrival_ns)
        exposure_s = self._frame_clock.to_monotonic(frame.stamp_ns) / NS
        self._vitals.meter("frames").tick(now_ns, (now_ns / NS - exposure_s) * 1e3)
        self._reflex.see(now_ns / NS, exposure_s, frame.cells, frame.seq, min(published, default=frame.stamp_ns))

    # --- out ---

    def _send(self, sent: Sent, now_ns: int) -> None:
        # From our monotonic clock to the UTC stamp of the contract.
        start_utc_ns = utc_ns() + round(sent.start_s * NS) - monotonic_ns()
        self._trajectories.publish(
            Trajectory(
                id=sent.id,
                goal_id=sent.goal_id,
                kind=sent.kind,
                start_ns=start_utc_ns,
                t_s=sent.curve.t_s,
                q_rad=np.ascontiguousarray(sent.curve.q_rad),
                dq_rad_s=np.ascontiguousarray(sent.curve.dq_rad_s),
                splice_trajectory_id=sent.splice[0] if sent.splice else None,
                splice_time_s=sent.splice[1] if sent.splice else None,
                voxels_seq=self._reflex.voxels_seq,
                held=box_of(self._parts.held),
            )
        )
        self._vitals.meter("trajectories").tick(now_ns, self._reflex.report.timing_ms.get("total"))
        if sent.motion is not None:
            self._learn_way(sent.motion.path.way, sent.motion.path.q_rad, self._reflex.vision.counts.cells, sent.goal_id)

    def _learn_way(self, way: str | None, q_rad: NDArray[np.float64], cells: NDArray[np.int32], label: str) -> None:
        """What the map did not know joins it, if there is room; who asks for it again may offer it again."""
        if way in ("repair", "fallback") and self._config.learning.from_ways:
            self._vitals.count(f"solved_by_{way}")
            self._learner.offer(Lesson(q_rad, label=label, source=way, cells=cells))

    def _publish_event(self, event: Event) -> None:
        self._n_events += 1
        log.info("%s %s %s", event.kind, event.goal_id or "", event.facts or "")
        self._events.publish(PlannerEvent(number=self._n_events, kind=event.kind, goal_id=event.goal_id, facts=event.facts))

    def _publish_status(self, now_ns: int) -> None:
        report, reflex = self._reflex.report, self._reflex
        self._next_status_ns = now_ns + STATUS_NS
        self._last_state = report.state
        complaints = ["perception uses another grid" if self._wrong_grid else "", self._memory.complaint]
        self._vitals.reasons = [complaint for complaint in complaints if complaint]
        self._vitals.counters["smoothing_fallbacks"] = report.smoothing_fallbacks
        if self._fallback is not None:
            self._vitals.counters["fallback_restarts"] = self._fallback.restarts
        self._statuses.publish(
            PlannerStatus(
                state=report.state,  # type: ignore[arg-type]
                goal_id=reflex.goal.id if reflex.goal else None,
                reason=report.reason,
                rule=report.rule,  # type: ignore[arg-type]
                way=report.way,
                refined=report.refined,
                rules=self._config.rules,
                model=self._parts.roadmap.model,
                n_neurons=self._parts.roadmap.n_neurons,
                n_blocked=reflex.vision.counts.n_blocked,
                path_length_rad=report.path_length_rad,
                path_neurons=report.path_neurons,
                clearance_m=reflex.clearance_m(now_ns / NS),
                timing_ms=report.timing_ms,
                reaction_ms=report.reaction_ms,
                replans=report.replans,
                accepted=report.accepted,
                held=box_of(self._parts.held),
            )
        )

    # --- commands ---

    def _answer(self) -> None:
        for goal in self._goals.take_all():
            reply_to(goal, self._set_goal)
        for cancel in self._cancels.take_all():
            reply_to(cancel, self._cancel)
        for query in self._maps.take_all():
            reply_to(query, lambda request: map_reply(request, self._parts, self._reflex))
        for lesson in self._learns.take_all():
            asked = lesson.request
            if not self._learner.offer(Lesson(asked.q_rad, asked.t_s, asked.label or "", command=lesson)):
                lesson.fail(RequestError(f"{self._config.learning.max_waiting} motions wait to be learned already", code="busy"))
        for plan in self._plans.take_all():
            if not self._questions.offer(plan, self._q_now, self._reflex.vision.counts.cells):
                plan.fail(RequestError(f"{QUESTIONS_WAITING} questions are waiting already", code="busy"))

    def _adopt_learned(self) -> None:
        """Exchange the map for one that has grown: references only, and a count of the cells that changed while it was prepared."""
        learned = self._learner.take()
        if learned is None:
            return
        began_ns = monotonic_ns()
        self._bare = learned.parts
        if self._held is None and self._parts.held is None:
            learned.adopt(self._reflex)
            self._parts = learned.parts
            if learned.desk is not None:
                self._questions.desk = learned.desk
        else:  # the map of what is held is made from the grown one
            self._carrier.want(self._bare, self._held)
        now_ns = monotonic_ns()
        self._vitals.meter("map_swap").tick(now_ns, (now_ns - began_ns) / 1e6)
        self._vitals.count("learned")
        self._publish_event(Event("learned", facts=learned.facts))
        self._publish_status(now_ns)
        if learned.lesson.command is not None:
            learned.lesson.command.reply(learned.reply)

    def _adopt_held(self) -> None:
        """Exchange arm, table and all that plans with them for those that reckon with what is held."""
        ready = self._carrier.take()
        if ready is None:
            return
        if ready.parts is None or ready.resolver is None or ready.desk is None:
            self._reflex.waiting = f"what the gripper holds: {ready.problem}"
            self._publish_event(Event("held", facts={"problem": ready.problem}))
            return
        began_ns = monotonic_ns()
        ready.adopt(self._reflex)
        self._parts, self._resolver, self._questions.desk = ready.parts, ready.resolver, ready.desk
        if self._courier is not None:
            self._courier.held = ready.payload
        self._reflex.waiting = ""
        now_ns = monotonic_ns()
        self._vitals.meter("held_swap").tick(now_ns, (now_ns - began_ns) / 1e6)
        table = ready.parts.roadmap.table
        facts = {"seconds": ready.seconds, "barred_neurons": len(table.barred_nodes), "barred_edges": len(table.barred_edges)}
        self._publish_event(Event("held", facts={"size_m": None if ready.payload is None else list(ready.payload.size_m), **facts}))
        self._publish_status(now_ns)

    def _set_goal(self, request: SetGoal) -> GoalAccepted:
        branches = branches_of(request, self._resolver)
        self._n_goals += 1
        goal_id = f"goal-{self._bus.epoch:x}-{self._n_goals}"
        self._reflex.set_goal(Goal(goal_id, branches, request.speed_scale or 1.0))
        return GoalAccepted(goal_id=goal_id)

    def _cancel(self, request: CancelGoal) -> Ack:
        goal = self._reflex.goal
        if request.goal_id is not None and (goal is None or goal.id != request.goal_id):
            raise RequestError(f"goal_id: {request.goal_id!r} is not the present goal", code="unknown_goal")
        self._reflex.cancel()
        return Ack()


def _log_progress() -> Callable[[str, float], None]:
    said: dict[str, int] = {}

    def progress(stage: str, share: float) -> None:
        tenth = int(share * 10)
        if said.get(stage) != tenth:
            said[stage] = tenth
            log.info("building the map: %s %d %%", stage, tenth * 10)

    return progress
