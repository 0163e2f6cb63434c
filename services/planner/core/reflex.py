"""The reflex: from goals, cells and the arm's state to trajectories, by the replan rules. Pure: instants are arguments.

The shell (:mod:`services.planner.service`) feeds what came in and sends what comes out. A replay that feeds the same inputs at the same
instants gets the same bytes out.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from common.robot.trajectory import JointTrajectory
from services.planner.config import PlannerConfig
from services.planner.core.asking import Asker
from services.planner.core.check import HandReach
from services.planner.core.found import NotFound
from services.planner.core.lookup import BlockedCounts
from services.planner.core.motion import Ask, Motion, MotionPlanner, Stopwatch
from services.planner.core.replan import Action, ReplanRules, ShorterWay, View
from services.planner.core.report import Event, Goal, Report
from services.planner.core.seeing_lag import SeeingLag
from services.planner.core.thinker import Thinker
from services.planner.core.timing import Limits, brake
from services.planner.core.underway import ArmState, Sent, Underway
from services.planner.core.vision import Vision
from services.planner.core.watching import Watch
from services.planner.core.ways import ThinkingRules

__all__ = ["Reflex"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
AT_GOAL_RAD = 2e-3  # the reference ends on the goal to rounding; this is a tenth of the tracking error allowed
LEAD_S = 0.02  # the robot is told so much before a takeover: transport and two control cycles
BRANCHES_A_STEP = 2  # inverse-kinematics branches tried at a time, so that no step takes long; the next attempt goes on with others


class Reflex:
    """One arm's planner: holds the goal, what is under way and what is seen.

    Args:
        planner: answers questions.
        vision: the live cells.
        limits: for stops.
        config: rules and times.
        clock_ns: for timings alone.
        name: prefix of trajectory ids, unique per start of the process.
    """

    def __init__(self, planner: MotionPlanner, vision: Vision, limits: Limits, config: PlannerConfig, clock_ns: Any, name: str) -> None:
        self.planner = planner
        self.checker = planner.checker
        self.vision = vision
        self._limits = limits
        self._config = config
        self._clock_ns = clock_ns
        self._name = name
        replan = config.replan
        self._rules = ReplanRules(replan.tick_s)
        self._shorter = ShorterWay(
            share=replan.shorter_share, least_rad=replan.shorter_rad, stable_s=replan.shorter_stable_s, corridor_rad=replan.corridor_rad
        )
        self.underway = Underway()
        self.goal: Goal | None = None
        self.report = Report()
        self._arm: ArmState | None = None
        self._seen_s = -np.inf
        self._frame_utc_ns = 0
        self._voxels_seq = 0
        self._cells_changed = False
        self._watch = Watch(self.checker, config.rules)
        self._n_sent = 0
        self._asker = Asker(planner, config, clock_ns)
        self.thinker = Thinker(planner, ThinkingRules.of(config), vision.grid)
        self._lag = SeeingLag()
        self._step_began_ns = 0
        self._told_reason = ""  # why there was no way, as it was told last: told once, though thinking says other things in between
        self.waiting = ""  # why the arm must stand until something is ready; empty: it need not
        self._events: list[Event] = []
        self._outbox: list[Sent] = []

    # --- inputs ---

    def set_goal(self, goal: Goal) -> None:
        """A new goal replaces the old one, also in motion."""
        self.goal = goal
        self.thinker.drop()
        self._asker.begin()
        self._told_reason = ""
        self._shorter.forget()
        self._rules.now_or_never()
        self.report.state, self.report.reason = "planning", ""
        self._events.append(Event("goal_accepted", goal.id, {"branches": len(goal.branches_rad)}))

    def cancel(self) -> None:
        """Give up the goal; an arm in motion is stopped by the next step."""
        if self.goal is not None:
            self._events.append(Event("goal_cancelled", self.goal.id))
        self.goal = None
        self.thinker.drop()
        self.report.state, self.report.reason = "idle", ""

    def rearm(self, planner: MotionPlanner, counts: BlockedCounts) -> None:
        """The arm is another one from now on (it holds something, or no more): all that plans and checks is exchanged at once.

        ``counts``: on the roadmap of ``planner``; brought to the live cells here.
        """
        self.planner, self.checker = planner, planner.checker
        self._asker.rearm(planner)
        self.thinker.rearm(planner)
        self._watch.rearm(planner.checker)
        self.vision.take(planner.finder.roadmap, counts)
        self._shorter.forget()
        self._told_reason = ""
        self._rules.now_or_never()

    def hear(self, arm: ArmState, now_s: float) -> None:
        """The arm's newest state."""
        self._arm = arm
        before = self.underway.sent
        accepted = self.underway.hear(arm, now_s)
        if accepted is not None:
            self._note_accepted(accepted, arm)
        if self.underway.sent is not before:
            self._watch.take_back()
            self._rules.now_or_never()

    def see(self, now_s: float, exposure_s: float, cells: I32, seq: int, published_utc_ns: int) -> None:
        """A frame of occupied cells (C,), ascending and unique; ``exposure_s`` its newest exposure on our clock."""
        began = self._clock_ns()
        self._seen_s = exposure_s
        self._voxels_seq = seq
        self._lag.hear(now_s, exposure_s)
        self._cells_changed |= self.vision.see(now_s, cells)
        self._frame_utc_ns = published_utc_ns
        self.report.timing_ms["update"] = (self._clock_ns() - began) / 1e6

    # --- the step ---

    def step(self, now_s: float) -> tuple[list[Sent], list[Event]]:
        """Decide and act; returns what to send and what to tell."""
        self._step_began_ns = self._clock_ns()
        if self._arm is not None:
            self._act(now_s, self._arm)
        self._cells_changed = False
        out, self._outbox = self._outbox, []
        events, self._events = self._events, []
        return out, events

    @property
    def voxels_seq(self) -> int:
        """Sequence number of the newest frame."""
        return self._voxels_seq

    def clearance_m(self, now_s: float) -> float | None:
        """Distance from the arm, where it is told to be, to all that is seen and to the static layer; None while that is not known."""
        if self._arm is None or now_s - self._seen_s > self._config.replan.stale_s:
            return None
        distance_m = self.checker.clearance(self.vision.seen, self._arm.q_reference_rad)
        return distance_m if np.isfinite(distance_m) else None

    def _act(self, now_s: float, arm: ArmState) -> None:
        if self.underway.sent is not None:
            from_s = max(0.0, self.underway.time_s(arm, now_s))
            self._watch.look(self.underway.sent, from_s, self.vision, self._hand(now_s), changed=self._cells_changed)
        view = self._view(now_s, arm)
        action = self._rules.decide(view)
        if action is Action.PLAN:
            self._plan_from_rest(now_s, arm)
        elif action is Action.DODGE:
            if not self._splice(now_s, arm, "none" if view.to_other_goal else "blocked"):
                action = self._rules.after_failed_dodge(view)
        elif action is Action.COMPARE:
            self._compare(now_s, arm)
        elif action is Action.ARRIVED:
            self._arrive()
        elif action is Action.NOTHING and self.thinker.wants_steps and view.may_plan_from_rest:
            self._think(now_s, arm)
        if action is Action.STOP:
            self._stop(now_s, arm, view.protective)
        self._tell_state(view)

    def _view(self, now_s: float, arm: ArmState) -> View:
        sent, goal = self.underway.sent, self.goal
        at_goal = goal is not None and bool(np.any(np.abs(goal.branches_rad - arm.q_reference_rad).max(axis=1) < AT_GOAL_RAD))
        blocked_in = None
        met_at_s = self._watch.met_at_s
        if sent is not None and met_at_s is not None:
            blocked_in = met_at_s - self.underway.time_s(arm, now_s)
        return View(
            now_s=now_s,
            has_goal=goal is not None,
            seeing=now_s - self._seen_s <= self._config.replan.stale_s,
            moving=sent is not None,
            stopping=sent is not None and sent.kind == "stop",
            at_goal=at_goal and arm.standing,
            to_other_goal=sent is not None and goal is not None and sent.kind == "motion" and sent.goal_id != goal.id,
            blocked_in_s=blocked_in,
            stop_needs_s=self._braking_s(arm) + self._config.replan.stop_margin_s + LEAD_S,
            cells_changed=self._cells_changed,
            protective=self.vision.protective or self.waiting,
            faulted=arm.mode == "fault",
        )

    def _hand(self, begins_s: float) -> HandReach:
        """What something that moves may have done until ``begins_s`` and may do after; slower eyes and answers mean more of it."""
        usual = self.planner.hand
        latency_s = max(usual.latency_s, self._lag.longest_s + self._asker.longest_s)
        return replace(usual, latency_s=latency_s, since_seen_s=max(0.0, begins_s - self._seen_s))

    def _braking_s(self, arm: ArmState) -> float:
        """Time in which the arm could stand, joint by joint v / a; along a path it may take a little longer."""
        return float(np.max(np.abs(arm.dq_reference_rad_s) / self._limits.acceleration))

    # --- actions ---

    def _plan_from_rest(self, now_s: float, arm: ArmState) -> None:
        answer, q_goal = self._ask(now_s, arm.q_reference_rad, None, BRANCHES_A_STEP)
        if isinstance(answer, NotFound):
            self._consider(now_s, arm, answer)
            return
        self._send_motion(answer, q_goal, now_s, now_s + self._asker.budget_s, "none", None)

    def _consider(self, now_s: float, arm: ArmState, why: NotFound) -> None:
        """The map has no way from where the arm stands: are there others?"""
        goal, config = self.goal, self._config
        assert goal is not None
        if why.outcome == "no_path" and config.rules == "checked":
            hand = self._hand(now_s + self._asker.budget_s)
            q = arm.q_reference_rad
            ask = Ask(q, q, None, config.rules, config.search, config.smoothing.smooth, goal.speed_scale, hand=hand)
            why = self.thinker.consider(goal.id, goal.branches_rad, ask, self.vision.world, why)
        if self.thinker.is_thinking:
            self.report.reason = f"{why.reason}; {self.thinker.word}"
        else:
            self._no_way(why)

    def _think(self, now_s: float, arm: ArmState) -> None:
        """One slice of a search that the map's answer was not enough for."""
        if self.goal is None or not self.thinker.is_about(self.goal.id, arm.q_reference_rad):
            self.thinker.drop()
            return
        outcome = self.thinker.advance(self.vision.world, Stopwatch(self._clock_ns, self.thinker.ms))
        self.report.timing_ms.update(self.thinker.ms)
        if isinstance(outcome, NotFound):
            self._no_way(outcome)
        elif outcome is not None:
            start_s = now_s + self._spent_s + self._asker.budget_s
            self._send_motion(outcome, outcome.path.q_rad[-1], now_s, start_s, "none", None)

    def _splice(self, now_s: float, arm: ArmState, rule: str) -> bool:
        """Leave the motion under way for a new one, a budget from now; False if there is no such way."""
        splice = self._splice_state(now_s, arm)
        if splice is None:
            return False
        at_s, q, dq = splice
        answer, q_goal = self._ask(now_s, q, dq, BRANCHES_A_STEP)
        if isinstance(answer, NotFound):
            self._no_way(answer)
            return False
        start_s = now_s + (at_s - self._time_s(arm, now_s))
        if now_s + self._spent_s > start_s - LEAD_S:
            return False  # it took too long; the budget has grown by that
        self._send_motion(answer, q_goal, now_s, start_s, rule, at_s)
        return True

    @property
    def _spent_s(self) -> float:
        """How long this step has taken so far."""
        return float(self._clock_ns() - self._step_began_ns) / 1e9

    def _compare(self, now_s: float, arm: ArmState) -> None:
        splice = self._splice_state(now_s, arm)
        if splice is None or self.underway.sent is None:
            return
        at_s, q, dq = splice
        answer, q_goal = self._ask(now_s, q, dq, 1)
        if isinstance(answer, NotFound):
            self._shorter.forget()
            return
        middle = answer.curve.sample(answer.curve.duration_s / 2.0)[0]
        if self._shorter.offer(now_s, answer.length_rad, self.underway.remaining(at_s), middle):
            self._send_motion(answer, q_goal, now_s, now_s + (at_s - self._time_s(arm, now_s)), "shorter", at_s)
            self._shorter.forget()

    def _splice_state(self, now_s: float, arm: ArmState) -> tuple[float, F64, F64] | None:
        """Time, position and velocity on the motion under way a budget from now; None when the way up to there is not free."""
        sent = self.underway.sent
        assert sent is not None
        at_s, met_at_s = self._time_s(arm, now_s) + self._asker.budget_s, self._watch.met_at_s
        if at_s < 0.0 or at_s >= sent.curve.duration_s or (met_at_s is not None and met_at_s <= at_s):
            return None
        q, dq, _ = sent.curve.sample(at_s)
        return at_s, q, dq

    def _time_s(self, arm: ArmState, now_s: float) -> float:
        return self.underway.time_s(arm, now_s)

    def _ask(self, now_s: float, q: F64, dq: F64 | None, branches: int) -> tuple[Motion | NotFound, F64]:
        goal, hand = self.goal, self._hand(now_s + self._asker.budget_s)
        assert goal is not None
        answer, q_goal, timing_ms = self._asker.ask(self.vision.world, goal.branches_rad, q, dq, branches, goal.speed_scale, hand)
        self.report.timing_ms = {"update": self.report.timing_ms.get("update", 0.0), **timing_ms}
        return answer, q_goal

    def _send_motion(self, motion: Motion, q_goal: F64, now_s: float, start_s: float, rule: str, splice_s: float | None) -> None:
        assert self.goal is not None
        self.thinker.drop()
        before = self.underway.sent
        splice = (before.id, splice_s) if before is not None and splice_s is not None else None
        cause = self._frame_utc_ns if self._cells_changed else 0
        self._send(Sent(self._next_id(), "motion", self.goal.id, motion.curve, start_s, now_s, motion, q_goal, rule, cause, splice))
        self.report.rule, self.report.way, self.report.refined = rule, motion.path.way, motion.refined
        self.report.path_length_rad = motion.length_rad
        self.report.path_neurons = len(motion.path.neurons)
        self.report.smoothing_fallbacks += motion.fell_back
        self.report.reason = self._told_reason = ""

    def _stop(self, now_s: float, arm: ArmState, why: str) -> None:
        sent = self.underway.sent
        assert sent is not None
        now_s += self._spent_s
        from_s = max(self._time_s(arm, now_s) + LEAD_S, 0.0)
        within, met_at_s = np.inf, self._watch.met_at_s
        if met_at_s is not None:
            within = max(0.0, met_at_s - from_s - self._config.replan.stop_margin_s)
        curve: JointTrajectory = brake(sent.curve, from_s, self._limits, within)
        reason = why or self.report.reason or "the way ahead is blocked"
        start_s = now_s + (from_s - self._time_s(arm, now_s))
        cause = self._frame_utc_ns if self._cells_changed else 0
        self._send(Sent(self._next_id(), "stop", sent.goal_id, curve, start_s, now_s, None, None, "blocked", cause, (sent.id, from_s)))
        self._events.append(Event("stopped", sent.goal_id, {"reason": reason}))

    def _send(self, sent: Sent) -> None:
        self.underway.send(sent)
        self._watch.begin()
        self._outbox.append(sent)

    def _next_id(self) -> str:
        self._n_sent += 1
        return f"{self._name}-{self._n_sent}"

    def _no_way(self, why: NotFound) -> None:
        self.underway.refused_reason = ""  # what the robot said of an earlier motion is no longer the point
        if self._told_reason != why.reason and self.goal is not None:
            self._events.append(Event("blocked", self.goal.id, {"outcome": why.outcome, "reason": why.reason}))
        self.report.reason = self._told_reason = why.reason

    def _arrive(self) -> None:
        assert self.goal is not None
        self._events.append(Event("goal_reached", self.goal.id))
        self.goal = None
        self._shorter.forget()

    def _note_accepted(self, sent: Sent, arm: ArmState) -> None:
        report = self.report
        report.accepted += 1
        if sent.kind != "motion" or sent.motion is None:
            return
        if sent.cause_utc_ns and sent.rule == "blocked":
            report.reaction_ms = (arm.accepted_utc_ns - sent.cause_utc_ns) / 1e6
        if sent.splice is not None or sent.rule != "none":
            report.replans += 1
            facts = {
                "rule": sent.rule,
                "reaction_ms": report.reaction_ms if sent.rule == "blocked" else None,
                "timing_ms": dict(report.timing_ms),
                "smoothing": sent.motion.smoothing,
                "way": sent.motion.path.way,
                "length_rad": sent.motion.length_rad,
            }
            self._events.append(Event("replanned", sent.goal_id, facts))

    def _tell_state(self, view: View) -> None:
        report, sent = self.report, self.underway.sent
        was = report.state
        if view.has_goal and not view.seeing:
            report.state, report.reason = "stale", "no fresh frame of cells"
        elif self.goal is None:
            report.state, report.reason = "idle", self.waiting
        elif view.protective:
            report.state, report.reason = "blocked", view.protective
        elif view.faulted:
            report.state, report.reason = "blocked", f"robot: {self._arm.reason if self._arm is not None else 'fault'}"
        elif sent is not None and sent.kind == "motion":
            report.state = "executing"
        elif self.underway.refused_reason:
            report.state, report.reason = "blocked", f"robot: {self.underway.refused_reason}"
        elif self.thinker.is_thinking:
            report.state = "planning"
        elif report.reason:
            report.state = "blocked"
        else:
            report.state = "planning"
        if report.state == "stale" and was != "stale":
            self._events.append(Event("stale", self.goal.id if self.goal else None))
