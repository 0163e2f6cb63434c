"""Whatever is sent to the executor, its reference keeps the joints' limits: checked on finite differences of the reference itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from services.robot_sim.config import ExecutorConfig
from services.robot_sim.core.executor import Executor
from tests.support.robot_sim_curves import LIMITS, NS, TICK_NS, motion, straight, swing

CONFIG = ExecutorConfig()
SUBSTEPS = 4
START_NS = 5_000_000_000_000
joint = st.floats(-2.5, 2.5)
target = st.tuples(joint, joint).map(np.array)
event = st.one_of(
    st.tuples(st.just("line"), target, st.integers(-40, 60)),  # ticks from now to its start
    st.tuples(st.just("splice"), target, st.integers(-6, 40)),  # ticks from now to the splice
    st.tuples(st.just("splice_newest"), target, st.integers(-6, 40)),
    st.tuples(st.just("prefix"), target, st.integers(1, 5)),  # late, but with the running curve as its beginning
    st.tuples(st.just("stop_curve"), target, st.integers(0, 20)),
    st.tuples(st.just("too_fast"), target, st.integers(0, 5)),
    st.tuples(st.just("jump"), target, st.integers(0, 5)),
    st.tuples(st.just("not_finite"), target, st.integers(0, 5)),
    st.tuples(st.just("ends_in_motion"), target, st.integers(0, 5)),
    st.tuples(st.just("brake"), target, st.integers(0, 0)),
    st.tuples(st.just("resume"), target, st.integers(0, 0)),
    st.tuples(st.just("blind"), target, st.integers(0, 40)),  # for so many ticks
    st.tuples(st.just("stall"), target, st.integers(1, 50)),
)


class Rig:
    """An executor with its clock, everything that it gave out, and what a planner would know of it."""

    def __init__(self) -> None:
        self.now_ns = START_NS
        self.executor = Executor(LIMITS, CONFIG, np.zeros(2), self.now_ns)
        self.q = [np.zeros(2)]
        self.blind_ticks = 0
        self.accepted = 0
        self.count = 0

    def run(self, ticks: int) -> None:
        for _ in range(ticks):
            lost = "blind" if self.blind_ticks > 0 else ""
            self.blind_ticks -= 1
            self.executor.tick(self.now_ns + TICK_NS, lost)
            self.q += [self.executor.reference(self.now_ns + (k + 1) * TICK_NS // SUBSTEPS)[0] for k in range(SUBSTEPS)]
            self.now_ns += TICK_NS

    def act(self, kind: str, goal: np.ndarray, ticks: int) -> None:
        if kind == "brake":
            return self.executor.stop("told to")
        if kind == "resume":
            return self.executor.resume()
        if kind == "blind":
            self.blind_ticks = ticks
            return None
        if kind == "stall":
            self.executor.later(ticks * TICK_NS)
            self.now_ns += ticks * TICK_NS
            return None
        self.count += 1
        sent = self._motion(kind, f"t{self.count}", goal, ticks)
        self.accepted += self.executor.submit(sent) is None
        return None

    def _motion(self, kind: str, id: str, goal: np.ndarray, ticks: int):
        at_ns = self.now_ns + ticks * TICK_NS
        timeline = self.executor._timeline
        into = timeline.newest if kind == "splice_newest" else timeline.active(self.now_ns)
        if kind in ("splice", "splice_newest"):
            q, dq = into.state(at_ns)
            return motion(id, swing(q, dq, q + 0.5 * dq + 0.3 * (goal - q)), splice=(into.id, (at_ns - into.start_ns) / NS))
        if kind == "prefix":
            begin_ns = max(self.now_ns - ticks * TICK_NS, into.takeover_ns)
            rest = timeline.remaining(self.now_ns)
            whole = replace(rest, t_s=rest.t_s)
            late_s = (self.now_ns - begin_ns) / NS
            curve = into.curve.sample(np.linspace((begin_ns - into.start_ns) / NS, (self.now_ns - into.start_ns) / NS, 5)[:-1])
            t = np.concatenate([np.linspace(0.0, late_s, 5)[:-1], whole.t_s + late_s]) if late_s > 0 else whole.t_s
            q = np.vstack([curve[0], whole.q_rad]) if late_s > 0 else whole.q_rad
            dq = np.vstack([curve[1], whole.dq_rad_s]) if late_s > 0 else whole.dq_rad_s
            return replace(motion(id, whole, splice=(into.id, (begin_ns - into.start_ns) / NS)), t_s=t, q_rad=q, dq_rad_s=dq)
        q, _ = timeline.state(max(timeline.end_ns, self.now_ns))
        line = straight(q, goal)
        if kind == "too_fast":
            line = replace(line, t_s=line.t_s * 0.9, dq_rad_s=line.dq_rad_s / 0.9)
        elif kind == "jump":
            line = replace(line, q_rad=line.q_rad + 0.01)
        elif kind == "not_finite":
            line = replace(line, q_rad=np.where(line.q_rad == line.q_rad[-1], np.nan, line.q_rad))
        elif kind == "ends_in_motion":
            line = replace(line, dq_rad_s=line.dq_rad_s + np.linspace(0.0, 0.5, len(line.t_s))[:, None])
        return motion(id, line, at_ns, kind="stop" if kind == "stop_curve" else "motion")


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(event, st.integers(0, 60)), min_size=1, max_size=12))
def test_limits_hold_for_any_stream(events: list) -> None:
    rig = Rig()
    for (kind, goal, ticks), wait in events:
        rig.act(kind, goal, ticks)
        rig.run(wait)
    rig.executor.stop("end")
    rig.run(150)
    q = np.array(rig.q)
    dt_s = TICK_NS / SUBSTEPS / NS
    slack = 1.0 + CONFIG.limit_tolerance
    velocity = np.diff(q, axis=0) / dt_s
    acceleration = np.diff(velocity, axis=0) / dt_s
    assert np.all(q <= LIMITS.position_max_rad + 1e-6) and np.all(q >= LIMITS.position_min_rad - 1e-6)
    assert np.all(np.abs(velocity).max(axis=0) <= LIMITS.max_velocity_rad_s * slack + 1e-6)
    assert np.all(np.abs(acceleration).max(axis=0) <= LIMITS.max_acceleration_rad_s2 * (slack + 0.002))
    assert not rig.executor.moving and np.array_equal(q[-1], q[-2])


def test_the_streams_do_move_the_arm() -> None:
    """The property above would hold for an executor that refuses everything."""
    rig = Rig()
    for kind in ("line", "splice", "splice_newest", "prefix", "prefix"):
        before = rig.accepted
        rig.act(kind, np.array([1.5, -1.0]) * (-1) ** rig.count, 3)
        assert rig.accepted == before + 1, (kind, rig.executor.status())
        rig.run(30)
    for kind in ("too_fast", "jump", "not_finite", "ends_in_motion"):
        before = rig.accepted
        rig.run(400)
        rig.act(kind, np.array([0.5, 0.5]), 3)
        assert rig.accepted == before, kind
