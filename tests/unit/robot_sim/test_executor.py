from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from common.robot.trajectory import JointTrajectory
from services.robot_sim.config import ExecutorConfig
from services.robot_sim.core.executor import Cause, Executor
from tests.support.robot_sim_curves import LIMITS, NS, TICK_NS, motion, straight, swing

GOAL = np.array([1.5, -1.0])
LINE = straight(np.zeros(2), GOAL)
SECOND = NS // TICK_NS


class Arm:
    """An executor and its clock."""

    def __init__(self) -> None:
        self.now_ns = 1_000 * NS
        self.executor = Executor(LIMITS, ExecutorConfig(), np.zeros(2), self.now_ns)
        self.lost = ""

    def run(self, ticks: int) -> None:
        for _ in range(ticks):
            self.now_ns += TICK_NS
            self.executor.tick(self.now_ns, self.lost)

    @property
    def q(self) -> np.ndarray:
        return self.executor.reference(self.now_ns)[0]

    @property
    def dq(self) -> np.ndarray:
        return self.executor.reference(self.now_ns)[1]

    @property
    def mode(self) -> str:
        return self.executor.status().mode

    def run_until_standing(self) -> int:
        for tick in range(10 * SECOND):
            if not self.executor.moving:
                return tick
            self.run(1)
        raise AssertionError("it never stands")

    def start(self, id: str = "a", ticks: int = 20) -> Arm:
        assert self.executor.submit(motion(id, LINE, self.now_ns)) is None
        self.run(ticks)
        return self


def test_drives_the_very_curve_and_is_idle_again() -> None:
    arm = Arm()
    start_ns = arm.now_ns + 10 * TICK_NS
    assert arm.executor.submit(motion("a", LINE, start_ns)) is None
    arm.run(5)
    waiting = arm.executor.status()
    assert (waiting.mode, waiting.trajectory_id) == ("tracking", "a")
    assert waiting.trajectory_time_s == pytest.approx(-5 * TICK_NS / NS)
    assert not arm.q.any()
    arm.run(30)
    assert np.array_equal(arm.q, LINE.sample((arm.now_ns - start_ns) / NS)[0])
    arm.run_until_standing()
    done = arm.executor.status()
    assert (done.mode, done.reason, done.trajectory_id, done.trajectory_time_s) == ("idle", "", "a", LINE.duration_s)
    assert np.array_equal(arm.q, GOAL)


def broken(**changes: object):
    return replace(motion("bad", LINE, 1_000 * NS), **changes)


@pytest.mark.parametrize(
    ("sent", "why"),
    [
        (broken(id=""), "no id"),
        (broken(t_s=np.zeros(0), q_rad=np.zeros((0, 2)), dq_rad_s=np.zeros((0, 2))), "non-empty"),
        (broken(q_rad=LINE.q_rad[:, :1]), "must have shape"),
        (broken(q_rad=np.full_like(LINE.q_rad, np.nan)), "not finite"),
        (broken(t_s=LINE.t_s[::-1]), "increase strictly"),
        (broken(t_s=np.arange(6000.0), q_rad=np.zeros((6000, 2)), dq_rad_s=np.zeros((6000, 2))), "6000 knots"),
        (broken(t_s=LINE.t_s / 2, dq_rad_s=LINE.dq_rad_s * 2), "velocity of joint"),
        (broken(q_rad=LINE.q_rad * 3, t_s=LINE.t_s * 3), "position of joint"),
        (broken(q_rad=LINE.q_rad + 0.01), "0.01 rad"),
        (broken(start_ns=999 * NS), "1.000 s in the past"),
        (broken(start_ns=1_020 * NS), "20.000 s ahead"),
        (broken(splice_id="nobody", splice_time_s=0.0), "'nobody'"),
        (broken(splice_id="", splice_time_s=None), "splice_time_s"),
        (broken(splice_id="", splice_time_s=float("inf")), "splice_time_s"),
        (broken(splice_id="", splice_time_s=1e18), "beyond the end"),
    ],
)
def test_refusals_say_why_and_move_nothing(sent, why: str) -> None:
    arm = Arm()
    refusal = arm.executor.submit(sent)
    assert refusal is not None and why in refusal
    arm.run(50)
    status = arm.executor.status()
    assert status.mode == "idle" and status.trajectory_id == "" and refusal in status.reason
    assert status.refused_id == sent.id
    assert not arm.q.any()
    arm.start()
    assert arm.executor.status().reason == ""


def test_a_refusal_from_outside_is_told_like_its_own() -> None:
    arm = Arm()
    assert arm.executor.refuse("late", "it reckons with something else") == "it reckons with something else"
    status = arm.executor.status()
    assert status.refused_id == "late" and "it reckons with something else" in status.reason and status.mode == "idle"
    arm.start()
    assert arm.executor.status().refused_id == ""


def test_a_curve_that_ends_in_motion_is_refused() -> None:
    half = JointTrajectory(LINE.t_s[:2], LINE.q_rad[:2], LINE.dq_rad_s[:2])
    assert "ends in motion" in str(Arm().executor.submit(motion("a", half, 1_000 * NS)))


def test_splice_takes_over_at_its_instant_whatever_the_start_stamp_says() -> None:
    arm = Arm().start(ticks=20)
    splice_s = 45 * TICK_NS / NS
    q, dq, _ = LINE.sample(splice_s)
    turn = swing(q, dq, np.array([-0.5, 0.5]))
    assert arm.executor.submit(motion("b", turn, start_ns=123, splice=("a", splice_s))) is None
    assert arm.executor.status().trajectory_time_s == pytest.approx(-25 * TICK_NS / NS)
    arm.run(24)
    assert np.array_equal(arm.q, LINE.sample(44 * TICK_NS / NS)[0])
    arm.run(26)
    assert np.allclose(arm.q, turn.sample(25 * TICK_NS / NS)[0])
    arm.run_until_standing()
    assert np.allclose(arm.q, [-0.5, 0.5])


def test_a_splice_into_what_has_given_way_is_refused() -> None:
    arm = Arm().start(ticks=20)
    q, dq, _ = LINE.sample(40 * TICK_NS / NS)
    assert arm.executor.submit(motion("b", swing(q, dq, q + 0.4 * dq), splice=("a", 40 * TICK_NS / NS))) is None
    refusal = arm.executor.submit(motion("c", LINE, splice=("a", 60 * TICK_NS / NS)))
    assert "given way to 'b'" in str(refusal)
    q, dq, _ = LINE.sample(30 * TICK_NS / NS)  # but one before b's takeover replaces b
    assert arm.executor.submit(motion("d", swing(q, dq, q + 0.4 * dq), splice=("a", 30 * TICK_NS / NS))) is None
    arm.run(25)
    assert arm.executor.status().trajectory_id == "d"
    assert arm.executor.status().trajectory_time_s == pytest.approx(15 * TICK_NS / NS)


def test_a_late_splice_enters_only_where_it_meets_the_reference() -> None:
    arm = Arm().start(ticks=40)
    q, dq, _ = LINE.sample(38 * TICK_NS / NS)
    elsewhere = motion("b", swing(q, dq, np.array([-0.5, 0.5])), splice=("a", 38 * TICK_NS / NS))
    assert "late" in str(arm.executor.submit(elsewhere))
    same = replace(motion("c", LINE), splice_id="a", splice_time_s=0.0)
    assert "in the past" in str(arm.executor.submit(same))  # 0.32 s
    arm = Arm().start(ticks=20)
    assert arm.executor.submit(same) is None  # the same curve again, 0.16 s late: nothing changes
    arm.run(1)
    assert np.array_equal(arm.q, LINE.sample(21 * TICK_NS / NS)[0])


def test_a_slightly_late_start_from_rest_begins_now() -> None:
    arm = Arm()
    assert arm.executor.submit(motion("a", LINE, arm.now_ns - NS // 10)) is None
    arm.run(10)
    assert np.array_equal(arm.q, LINE.sample(10 * TICK_NS / NS)[0])


def test_without_a_splice_a_moving_arm_takes_nothing() -> None:
    arm = Arm().start()
    before = arm.executor.status()
    assert arm.executor.submit(motion("b", straight(np.zeros(2), -GOAL), arm.now_ns)) is not None
    assert (before.trajectory_id, before.mode) == ("a", "tracking") == (arm.executor.status().trajectory_id, arm.mode)


def test_stop_brakes_on_the_path_holds_refuses_and_resumes() -> None:
    arm = Arm().start(ticks=50)
    speed = np.abs(arm.dq)
    arm.executor.stop("told to")
    arm.run(1)
    assert (arm.mode, arm.executor.status().reason) == ("stopping", "told to")
    ticks = arm.run_until_standing()
    assert ticks * TICK_NS / NS <= (speed / LIMITS.max_acceleration_rad_s2).max() + 2 * TICK_NS / NS
    status = arm.executor.status()
    assert status.mode == "holding"
    assert np.allclose(arm.q, LINE.sample(status.trajectory_time_s)[0], atol=1e-6)
    here = arm.q
    again = motion("b", straight(here, np.zeros(2)), arm.now_ns)
    assert "robot/resume" in str(arm.executor.submit(again))
    arm.run(50)
    assert arm.executor.status().trajectory_time_s == status.trajectory_time_s
    arm.executor.resume()
    assert arm.mode == "idle"
    assert arm.executor.submit(replace(again, start_ns=arm.now_ns)) is None
    arm.run_until_standing()
    assert np.allclose(arm.q, 0.0)


def test_lost_senses_brake_at_once_and_work_goes_on_by_itself() -> None:
    arm = Arm().start(ticks=50)
    speed = np.abs(arm.dq)
    arm.lost = "planner is not there"
    arm.run(1)
    assert arm.mode == "stopping"
    ticks = 1 + arm.run_until_standing()
    assert ticks * TICK_NS / NS <= (speed / LIMITS.max_acceleration_rad_s2).max() + 0.05
    assert (arm.mode, arm.executor.status().reason) == ("holding", "planner is not there")
    again = motion("b", straight(arm.q, GOAL), arm.now_ns + TICK_NS)
    assert "planner is not there" in str(arm.executor.submit(again))
    arm.lost = ""
    arm.run(1)
    assert arm.mode == "idle"
    assert arm.executor.submit(again) is None
    arm.run_until_standing()
    assert np.allclose(arm.q, GOAL)


def test_a_standing_arm_without_a_planner_is_idle_with_a_reason() -> None:
    arm = Arm()
    arm.lost = "planner is not there"
    arm.run(100)
    assert (arm.mode, arm.executor.status().reason) == ("idle", "planner is not there")
    assert "not there" in str(arm.executor.submit(motion("a", LINE, arm.now_ns)))


def test_a_stop_by_command_outlives_lost_senses() -> None:
    arm = Arm().start(ticks=50)
    arm.executor.stop("told to")
    arm.lost = "blind"
    arm.run_until_standing()
    arm.lost = ""
    arm.run(5)
    assert (arm.mode, arm.executor.status().reason) == ("holding", "told to")


def test_lost_senses_drop_a_motion_that_waits_for_its_start() -> None:
    arm = Arm()
    assert arm.executor.submit(motion("a", LINE, arm.now_ns + NS)) is None
    arm.lost = "blind"
    arm.run(5)
    arm.lost = ""
    arm.run(3 * SECOND)
    assert arm.mode == "idle" and not arm.q.any()


def test_a_stop_trajectory_ends_in_holding_and_the_next_motion_goes_on() -> None:
    arm = Arm().start(ticks=20)
    q, dq, _ = LINE.sample(30 * TICK_NS / NS)
    assert arm.executor.submit(motion("s", swing(q, dq, q + 0.1 * np.sign(dq)), kind="stop", splice=("a", 30 * TICK_NS / NS))) is None
    arm.run(15)
    assert arm.mode == "stopping"
    arm.run_until_standing()
    assert (arm.mode, arm.executor.status().reason) == ("holding", "stopped by the planner")
    assert arm.executor.submit(motion("b", straight(arm.q, GOAL), arm.now_ns)) is None
    arm.run(5)
    assert arm.mode == "tracking"


def test_a_fault_needs_a_hand() -> None:
    arm = Arm().start(ticks=50)
    arm.executor.stop("jammed", Cause.FAULT)
    arm.executor.stop("told to")  # weaker: the fault stays
    arm.run_until_standing()
    assert (arm.mode, arm.executor.status().reason) == ("fault", "jammed")
    arm.executor.reset(np.zeros(2), arm.now_ns)
    assert (arm.mode, arm.executor.status().trajectory_id) == ("idle", "")


def test_lost_time_moves_the_curve_not_the_arm() -> None:
    arm = Arm().start(ticks=30)
    before = arm.q
    arm.executor.later(NS)
    arm.now_ns += NS
    assert np.array_equal(arm.q, before)
    arm.run(1)
    assert np.array_equal(arm.q, LINE.sample(31 * TICK_NS / NS)[0])
    assert arm.executor.status().trajectory_time_s == pytest.approx(31 * TICK_NS / NS)
