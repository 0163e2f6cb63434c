"""Questions (``planner/plan``) answered on own buffers, in a thread of their own: they move nothing and delay no dodge."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from common.errors import RequestError
from common.robot.payload import Payload
from common.wire.messages import HeldBox, PlanReply, PlanRequest, SetGoal, Trajectory
from services.planner.assemble import Parts
from services.planner.core.find import SEARCHES
from services.planner.core.found import NotFound, Way
from services.planner.core.goals import GoalResolver
from services.planner.core.motion import Ask, Motion, Stopwatch
from services.planner.core.ways import Sampler, Thinking, ThinkingRules, think
from services.planner.core.world import World

__all__ = ["QuestionDesk", "box_of", "branches_of"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]


def box_of(payload: Payload | None) -> HeldBox | None:
    """What is held, as a message says it."""
    if payload is None:
        return None
    return HeldBox(size_m=list(payload.size_m), position_m=list(payload.position_m), quaternion_xyzw=list(payload.quaternion_xyzw))


def branches_of(goal: SetGoal, resolver: GoalResolver) -> F64:
    """(B, J) joint vectors of a goal message; see :class:`~services.planner.core.goals.GoalResolver` for the errors."""
    given = [name for name in ("q_rad", "pose", "name") if getattr(goal, name) is not None]
    if len(given) != 1:
        raise RequestError(f"a goal needs exactly one of q_rad, pose, name; got {given or 'none'}", code="bad_goal")
    if goal.constraint is not None:
        raise RequestError(f"constraint: {goal.constraint!r} is not supported", code="unsupported")
    if goal.speed_scale is not None and not 0.0 < goal.speed_scale <= 1.0:
        raise RequestError(f"speed_scale: {goal.speed_scale} is outside (0, 1]", code="out_of_range")
    if goal.q_rad is not None:
        return resolver.joints(goal.q_rad)
    if goal.pose is not None:
        return resolver.pose(goal.pose.position_m, goal.pose.quaternion_xyzw)
    return resolver.name(str(goal.name))


class QuestionDesk:
    """Answers one question after the other; equal questions on equal cells get equal answers.

    Args:
        parts: map, robot, config.
        clock_ns: for timings alone.
        sampler: puts questions to the fallback; None: there is none.
    """

    def __init__(self, parts: Parts, clock_ns: Callable[[], int], sampler: Sampler | None = None) -> None:
        self._parts = parts
        ways = [way for way in parts.config.ways if way != "fallback" or sampler is not None]
        self._rules = replace(ThinkingRules.of(parts.config), ways=ways)
        self._sampler = sampler
        self._clock_ns = clock_ns
        self._planner = parts.motion_planner()
        self._resolver = parts.goal_resolver()
        self._counts = parts.roadmap.counts(parts.grid)

    def answer(self, request: PlanRequest, q_now: F64 | None, live_cells: I32) -> PlanReply:
        """The answer to a question.

        Args:
            request: as received.
            q_now: (J,) where the arm is, for questions without a start.
            live_cells: (C,) ascending, for questions without cells.

        Raises:
            RequestError: anything in the request is impossible; names place and value.
        """
        config = self._parts.config
        search, rules = request.search or config.search, request.rules or config.rules
        if search not in SEARCHES:
            raise RequestError(f"search: {search!r} is not supported; one of {', '.join(SEARCHES)}", code="unsupported")
        if request.model is not None and request.model != self._parts.roadmap.model:
            raise RequestError(f"model: {request.model!r} is not loaded; loaded is {self._parts.roadmap.model!r}", code="unsupported")
        q_start = self._start(request, q_now)
        branches = branches_of(request.goal, self._resolver)
        cells = live_cells if request.cells is None else self._cells(request.cells, request.grid_fingerprint)
        smooth = config.smoothing.smooth if request.smooth is None else request.smooth
        watch = Stopwatch(self._clock_ns)
        began = watch.clock_ns()
        self._counts.set_cells(np.setdiff1d(cells, self._parts.roadmap.table.unavoidable, assume_unique=True))
        world = World.of(self._parts.grid, self._counts)
        watch.add("update", began)
        speed = request.goal.speed_scale or 1.0
        ways = [way for way in self._rules.ways if request.ways is None or way in request.ways]
        answer = self._answer(world, Ask(q_start, q_start, None, rules, search, smooth, speed), branches, ways, watch)
        watch.add("total", began)
        if isinstance(answer, Motion):
            ask = Ask(q_start, answer.path.q_rad[-1], None, rules, search, smooth, speed)
            answer = self._planner.refined(world, ask, answer, watch) if request.refine else answer
            return _reply(answer, smooth, watch.ms, self._parts.held)
        return _refusal(answer, len(q_start), watch.ms)

    def _answer(self, world: World, ask: Ask, branches: F64, ways: list[Way], watch: Stopwatch) -> Motion | NotFound:
        """By the map, nearest branch first; else, where a branch is free and the map has no way to it, by the other ways."""
        refusals: list[NotFound] = []
        for q_goal in branches[np.argsort(np.linalg.norm(branches - ask.q_start, axis=1), kind="stable")]:
            answer = self._planner.answer(world, replace(ask, q_goal=q_goal), watch)
            if isinstance(answer, Motion):
                return answer
            refusals.append(answer)
        no_path = [refusal for refusal in refusals if refusal.outcome == "no_path"]
        if ask.rules == "paper" or not no_path:
            return refusals[0]
        thinking = Thinking(self._planner, world, ask, branches, replace(self._rules, ways=ways), no_path[0].reason)
        return think(thinking, world, watch, self._sampler)

    def _start(self, request: PlanRequest, q_now: F64 | None) -> F64:
        if request.q_start_rad is None:
            if q_now is None:
                raise RequestError("q_start_rad: absent, and the robot's state is not known yet", code="no_robot")
            return q_now
        violation = self._parts.robot.limit_violation(request.q_start_rad)
        if violation:
            raise RequestError(f"q_start_rad: {violation}", code="out_of_limits")
        return np.ascontiguousarray(request.q_start_rad)

    def _cells(self, cells: I32, fingerprint: str | None) -> I32:
        grid = self._parts.grid
        if fingerprint != grid.fingerprint:
            raise RequestError(
                f"grid_fingerprint: {fingerprint!r} is not this planner's grid {grid.fingerprint!r}",
                code="foreign_grid",
                facts={"origin_m": list(grid.origin_m), "shape": list(grid.shape), "resolution_m": grid.resolution_m},
            )
        flat = np.unique(cells.ravel())
        if len(flat) and (flat[0] < 0 or flat[-1] >= grid.n_cells):
            bad = int(flat[0] if flat[0] < 0 else flat[-1])
            raise RequestError(f"cells: {bad} is outside 0..{grid.n_cells - 1}", code="out_of_range")
        return flat


def _reply(motion: Motion, smooth: bool, timing_ms: dict[str, float], held: Payload | None) -> PlanReply:
    curve = motion.curve
    return PlanReply(
        outcome="path",
        way=motion.path.way,
        neurons=motion.path.neurons,
        path_q_rad=motion.path.q_rad,
        smooth_q_rad=curve.q_rad if smooth else None,
        trajectory=Trajectory(
            id="",
            goal_id="",
            kind="motion",
            start_ns=0,
            t_s=curve.t_s,
            q_rad=curve.q_rad,
            dq_rad_s=curve.dq_rad_s,
            voxels_seq=0,
            held=box_of(held),
        ),
        length_rad=motion.path.length_rad,
        refined=motion.refined,
        timing_ms=timing_ms,
        reason=motion.smoothing,
    )


def _refusal(why: NotFound, n_joints: int, timing_ms: dict[str, float]) -> PlanReply:
    return PlanReply(
        outcome=why.outcome,
        neurons=np.empty(0, dtype=np.int32),
        path_q_rad=np.empty((0, n_joints)),
        length_rad=0.0,
        timing_ms=timing_ms,
        reason=why.reason,
    )
