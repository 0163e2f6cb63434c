"""The hand and the arm that follows it: limits, arrival, refusals, and what the executor makes of it."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from common.errors import RequestError
from common.robot.trajectory import validate
from services.robot_sim.config import ExecutorConfig, GuideConfig
from services.robot_sim.core.admission import Motion
from services.robot_sim.core.executor import Executor
from services.robot_sim.core.follower_kernels import follow
from services.robot_sim.core.guiding import guided_curve
from services.robot_sim.core.hand import STEP_S, HandPoint, hand_path
from services.robot_sim.core.limits import Limits, violation
from tests.support.cell import ur3
from tests.support.robot_sim_curves import NS, TICK_NS, motion, straight
from tests.support.slow_follower import slow_step

ROBOT, CONFIG = ur3(), GuideConfig()
HOME, T_HOME = ROBOT.home_rad, ROBOT.tool_pose(ROBOT.home_rad)
LIMITS = Limits(ROBOT.position_min_rad, ROBOT.position_max_rad, ROBOT.max_velocity_rad_s, ROBOT.max_acceleration_rad_s2)
HALF = Limits(LIMITS.position_min_rad, LIMITS.position_max_rad, 0.5 * LIMITS.max_velocity_rad_s, 0.5 * LIMITS.max_acceleration_rad_s2)


def to(*by_m: float, quaternion: list[float] | None = None, speed: float = 0.2, rest: float = 0.0) -> HandPoint:
    """A waypoint relative to where the tool is at home."""
    return HandPoint((T_HOME[:3, 3] + np.array(by_m)).tolist(), quaternion, speed, rest)


SQUARE = [to(0.0, 0.1, 0.1), to(0.05, 0.1, 0.1), to(0.05, -0.3, 0.1, rest=0.5), to(0.0, 0.0, 0.0)]


def test_the_hand_goes_straight_and_at_its_speed() -> None:
    path = hand_path(T_HOME, [to(0.0, 0.3, 0.0, rest=0.1), to(0.0, 0.3, 0.1)], CONFIG)
    steps = np.linalg.norm(np.diff(path.position_m, axis=0), axis=1)
    assert steps.max() <= 0.2 * STEP_S + 1e-12 and path.arrives.tolist() == [80, 105]
    np.testing.assert_allclose(path.position_m[75:81], [to(0.0, 0.3, 0.0).position_m] * 6)
    np.testing.assert_allclose(path.rotation, np.repeat(T_HOME[None, :3, :3], 106, axis=0), atol=1e-12)


def test_the_tool_is_dragged_to_the_end_within_half_the_limits() -> None:
    curve = guided_curve(ROBOT, HOME, SQUARE, CONFIG)
    assert validate(curve.t_s, curve.q_rad, curve.dq_rad_s, 6) is None
    assert violation(curve, HALF, 1e-9) is None
    np.testing.assert_array_equal(curve.q_rad[0], HOME)
    assert not curve.dq_rad_s[0].any() and not curve.dq_rad_s[-1].any()
    np.testing.assert_allclose(ROBOT.tool_pose(curve.q_rad[-1])[:3, 3], SQUARE[-1].position_m, atol=0.004)
    tool = np.array([ROBOT.tool_pose(q)[:3, 3] for q in curve.q_rad])
    for point in SQUARE:
        assert np.linalg.norm(tool - point.position_m, axis=1).min() < 0.07  # behind the hand it cuts corners


def test_a_turn_of_the_hand_turns_the_tool() -> None:
    turned = [0.9659258, 0.2588190, 0.0, 0.0]  # pointing down, turned by 30 degrees about the vertical
    curve = guided_curve(ROBOT, HOME, [to(0.0, 0.1, 0.05, quaternion=turned)], CONFIG)
    T = ROBOT.tool_pose(curve.q_rad[-1])
    x, y, z, w = turned
    assert T[0, 0] == pytest.approx(1 - 2 * (y * y + z * z), abs=0.03) and T[1, 0] == pytest.approx(2 * (x * y + w * z), abs=0.03)


def test_equal_paths_give_equal_curves() -> None:
    one, two = (guided_curve(ROBOT, HOME, SQUARE, CONFIG) for _ in range(2))
    assert one.q_rad.tobytes() == two.q_rad.tobytes()


def test_the_kernel_does_what_its_twin_does() -> None:
    path = hand_path(T_HOME, SQUARE[:2], CONFIG)
    n = 50
    q, dq, lag = np.zeros((n, 6)), np.zeros((n, 6)), np.zeros((n, 2))
    q[0] = HOME
    low, high, speed, acceleration = HALF.position_min_rad, HALF.position_max_rad, HALF.max_velocity_rad_s, HALF.max_acceleration_rad_s2
    tool = np.ascontiguousarray(ROBOT.T_joint_tool)
    filled = follow(
        ROBOT.chain, tool, path.position_m, path.rotation, STEP_S, 4.0, 0.02, low, high, speed, acceleration, (1e-3, 1e-2), q, dq, lag
    )
    assert filled == n
    for k in range(n - 1):
        T_hand = np.eye(4)
        T_hand[:3, :3], T_hand[:3, 3] = path.rotation[k], path.position_m[k]
        q_next, dq_next = slow_step(ROBOT, q[k], dq[k], T_hand, step_s=STEP_S, pull_per_s=4.0, damping=0.02, share=0.5)
        np.testing.assert_allclose(q[k + 1], q_next, atol=1e-7)
        np.testing.assert_allclose(dq[k + 1], dq_next, atol=1e-5)
        assert lag[k, 0] == pytest.approx(np.linalg.norm(T_hand[:3, 3] - ROBOT.tool_pose(q[k])[:3, 3]), abs=1e-9)


def test_a_joint_near_its_limit_stops_before_it() -> None:
    """The base may turn by 0.3 rad only; the hand asks for more: refused, and at a tolerance that lets it, the limit still holds."""
    tight = msgspec.structs.replace(CONFIG, lag_max_m=10.0, lag_max_rad=10.0)
    narrow = type(ROBOT)(**{**ROBOT.__dict__, "position_max_rad": np.array([0.3, 3.14, 3.14, 3.14, 3.14, 3.14])})
    aside = [to(-0.05, 0.25, 0.0)]
    with pytest.raises(RequestError, match="cannot follow"):
        guided_curve(narrow, HOME, aside, CONFIG)
    path = hand_path(T_HOME, aside, tight)
    q, dq, lag = np.zeros((400, 6)), np.zeros((400, 6)), np.zeros((400, 2))
    q[0] = HOME
    tool = np.ascontiguousarray(ROBOT.T_joint_tool)
    follow(
        narrow.chain, tool, path.position_m, path.rotation, STEP_S, 4.0, 0.02, narrow.position_min_rad, narrow.position_max_rad,
        HALF.max_velocity_rad_s, HALF.max_acceleration_rad_s2, (1e-3, 1e-2), q, dq, lag,
    )  # fmt: skip
    assert 0.2 < q[:, 0].max() <= 0.3


@pytest.mark.parametrize(
    ("points", "code", "words"),
    [
        ([], "bad_guide", "0 given"),
        ([to(0, 0, 0.1)] * 101, "bad_guide", "101 given"),
        ([to(0, 0, 0.1), HandPoint([0.1, 0.2], None, 0.1, 0.0)], "bad_guide", "waypoints[1].position_m"),
        ([HandPoint([0.1, 0.2, float("nan")], None, 0.1, 0.0)], "bad_guide", "nan"),
        ([to(0, 0, 0.1, quaternion=[0.0, 0.0, 0.0, 0.0])], "bad_guide", "no length"),
        ([to(0, 0, 0.1, quaternion=[0.0, 0.0, 1.0])], "bad_guide", "needs 4"),
        ([to(0, 0, 0.1, speed=0.3)], "out_of_range", "0.3 is outside"),
        ([to(0, 0, 0.1, speed=float("nan"))], "out_of_range", "nan"),
        ([to(0, 0, 0.1, speed=0.0)], "out_of_range", "speed_m_s"),
        ([to(0, 0, 0.1, rest=-1.0)], "out_of_range", "rest_s"),
        ([to(0, 0, 0.1), to(0, 0, 0.1, rest=59.9)], "too_long", "waypoints[1]"),
        ([HandPoint([1e308, 0.0, 0.0], None, 1e-300, 0.0)], "too_long", "waypoints[0]"),
        ([to(0, 0, 0.1), to(0, 0, 1.5)], "out_of_reach", "waypoints[1]"),
    ],
)
def test_what_cannot_be_guided_is_refused_by_place_and_value(points: list[HandPoint], code: str, words: str) -> None:
    with pytest.raises(RequestError) as caught:
        guided_curve(ROBOT, HOME, points, CONFIG)
    assert caught.value.code == code and words in caught.value.message


class Arm:
    def __init__(self) -> None:
        self.now_ns = 1_000 * NS
        self.executor = Executor(LIMITS, ExecutorConfig(), HOME, self.now_ns)
        self.curve = guided_curve(ROBOT, HOME, SQUARE, CONFIG)

    def guide(self) -> str | None:
        return self.executor.guide(Motion("guide-1", "motion", self.now_ns, self.curve.t_s, self.curve.q_rad, self.curve.dq_rad_s))

    def run(self, ticks: int, lost: str = "") -> None:
        for _ in range(ticks):
            self.now_ns += TICK_NS
            self.executor.tick(self.now_ns, lost)


def test_a_guided_arm_says_so_and_takes_no_trajectory() -> None:
    arm = Arm()
    assert arm.guide() is None
    arm.run(50)
    status = arm.executor.status()
    assert (status.mode, status.reason, status.trajectory_id) == ("tracking", "guided by hand", "guide-1")
    refusal = arm.executor.submit(motion("a", straight(HOME, HOME + 0.1, LIMITS), arm.now_ns))
    assert refusal is not None and "guided by hand" in refusal
    assert arm.guide() is not None  # nor a second hand
    arm.run(round(arm.curve.duration_s * NS / TICK_NS))
    assert arm.executor.status().mode == "idle" and not arm.executor.guided
    np.testing.assert_array_equal(arm.executor.reference(arm.now_ns)[0], arm.curve.q_rad[-1])


def test_guiding_is_refused_while_a_trajectory_runs_or_waits() -> None:
    arm = Arm()
    assert arm.executor.submit(motion("a", straight(HOME, HOME + 0.1, LIMITS), arm.now_ns + NS)) is None
    refusal = arm.guide()
    assert refusal is not None and "'a'" in refusal and not arm.executor.guided


@pytest.mark.parametrize(("how", "reason"), [("release", "the hand let go"), ("stop", "robot/stop"), ("lost", "no planner")])
def test_it_ends_by_letting_go_by_stop_and_by_the_watchdog(how: str, reason: str) -> None:
    arm = Arm()
    arm.guide()
    arm.run(150)
    speed = np.abs(arm.executor.reference(arm.now_ns)[1]).max()
    assert speed > 0.05
    if how == "release":
        arm.executor.release()
    elif how == "stop":
        arm.executor.stop("stopped by robot/stop")
    arm.run(1, lost="no planner" if how == "lost" else "")
    assert arm.executor.status().mode == "stopping" and reason in arm.executor.status().reason
    arm.run(100, lost="no planner" if how == "lost" else "")
    assert arm.executor.status().mode == "holding" and not arm.executor.guided
    arm.run(1)
    after = motion("b", straight(arm.executor.reference(arm.now_ns)[0], HOME, LIMITS), arm.now_ns)
    assert (arm.executor.submit(after) is None) == (how != "stop")


def test_letting_go_of_an_arm_that_is_not_guided_does_nothing() -> None:
    arm = Arm()
    arm.executor.submit(motion("a", straight(HOME, HOME + 0.1, LIMITS), arm.now_ns))
    arm.run(5)
    arm.executor.release()
    arm.run(1)
    assert arm.executor.status().mode == "tracking"
