from __future__ import annotations

import math

import numpy as np
import pytest

from common.errors import RequestError
from services.robot_sim.core.obstacles import Manners, Obstacles, Waypoint, pose_of
from services.robot_sim.core.scripts import Pose

ORIGIN = pose_of([0.0, 0.0, 0.0], None, "test")
DT = 0.008
MANNERS = Manners(gap_m=0.03, room_m=0.1)


def book(*, max_obstacles: int = 8) -> Obstacles:
    obstacles = Obstacles(max_obstacles, ["table"])
    obstacles.add("hand", "box", [0.1, 0.1, 0.1], ORIGIN, None)
    return obstacles


def far(_thing, _pose: Pose) -> float:
    return 1.0


def run(obstacles: Obstacles, seconds: float, gap_m=far, *, arm_stands: bool = True) -> None:
    for _ in range(round(seconds / DT)):
        obstacles.step(DT, gap_m, MANNERS, arm_stands)


def x_of(obstacles: Obstacles) -> float:
    return float(obstacles.get("hand").pose.position_m[0])


def test_script_goes_rests_turns_and_ends() -> None:
    obstacles = book()
    half_turn = [0.0, 0.0, 1.0, 0.0]
    obstacles.script("hand", [Waypoint([1.0, 0.0, 0.0], None, 0.25, 1.0), Waypoint([1.0, 0.0, 0.0], half_turn, 0.25, 0.0)], False)
    run(obstacles, 2.0)
    assert x_of(obstacles) == pytest.approx(0.5)
    assert obstacles.get("hand").velocity_m_s == pytest.approx([0.25, 0.0, 0.0])
    run(obstacles, 2.4)
    assert x_of(obstacles) == 1.0 and not obstacles.get("hand").velocity_m_s.any()
    run(obstacles, 0.6 + math.pi / 2)  # half of the turn at 1 rad/s
    assert abs(obstacles.get("hand").pose.quaternion_xyzw @ [0, 0, math.sqrt(0.5), math.sqrt(0.5)]) == pytest.approx(1.0, abs=1e-4)
    run(obstacles, 2.0)
    assert obstacles.get("hand").motion is None
    assert abs(obstacles.get("hand").pose.quaternion_xyzw @ half_turn) == pytest.approx(1.0)


def test_loop_comes_back_and_legs_without_length_do_not_hang() -> None:
    obstacles = book()
    obstacles.script("hand", [Waypoint([0.4, 0, 0], None, 0.4, 0.0), Waypoint([0, 0, 0], None, 0.4, 0.0)], True)
    run(obstacles, 5.0)
    assert x_of(obstacles) == pytest.approx(0.4, abs=1e-6)
    obstacles.script("hand", [Waypoint([0.4, 0, 0], None, 0.4, 0.0)] * 3, True)
    run(obstacles, 0.1)
    assert x_of(obstacles) == pytest.approx(0.4, abs=1e-6)


def test_velocity_is_the_true_one() -> None:
    obstacles = book()
    obstacles.script("hand", [Waypoint([1, 2, 0], None, 0.5, 0.2), Waypoint([0, 0, 1], None, 1.0, 0.2)], True)
    for _ in range(2000):
        before = obstacles.get("hand")
        obstacles.step(DT, far, MANNERS, False)
        after = obstacles.get("hand")
        if np.array_equal(before.velocity_m_s, after.velocity_m_s):
            moved = (after.pose.position_m - before.pose.position_m) / DT
            assert moved == pytest.approx(after.velocity_m_s, abs=1e-9)


def test_drift_goes_on_until_moved() -> None:
    obstacles = book()
    obstacles.move("hand", ORIGIN, [0.1, 0.0, 0.0])
    run(obstacles, 4.0)
    assert x_of(obstacles) == pytest.approx(0.4)
    obstacles.move("hand", ORIGIN, None)
    run(obstacles, 1.0)
    assert x_of(obstacles) == 0.0 and not obstacles.get("hand").velocity_m_s.any()


def test_waits_three_centimetres_from_a_standing_arm_and_goes_on_when_there_is_room() -> None:
    obstacles = book()
    obstacles.script("hand", [Waypoint([1.0, 0, 0], None, 0.25, 0.0), Waypoint([0.0, 0, 0], None, 0.25, 0.0)], False)
    arm_x = [0.5]

    def gap_m(_thing, pose: Pose) -> float:
        return abs(arm_x[0] - float(pose.position_m[0]))

    run(obstacles, 6.0, gap_m)
    assert 0.03 <= arm_x[0] - x_of(obstacles) < 0.033
    assert not obstacles.get("hand").velocity_m_s.any()
    arm_x[0] = -5.0
    run(obstacles, 1.0, gap_m)
    assert x_of(obstacles) == pytest.approx(0.47 + 0.25, abs=0.005)
    arm_x[0] = x_of(obstacles) - 0.01  # the arm now stands behind it, much too near: going away is always allowed
    run(obstacles, 0.4, gap_m)
    assert x_of(obstacles) > 0.8


def test_who_waits_does_not_ram_an_arm_that_starts_and_who_does_not_wait_is_not_held_up_by_a_moving_one() -> None:
    obstacles = book()
    obstacles.script("hand", [Waypoint([1.0, 0, 0], None, 0.25, 0.0)], False)
    arm_x = [0.5]

    def gap_m(_thing, pose: Pose) -> float:
        return abs(arm_x[0] - float(pose.position_m[0]))

    run(obstacles, 4.0, gap_m)
    run(obstacles, 1.0, gap_m, arm_stands=False)  # the arm moves, but not away
    assert x_of(obstacles) == pytest.approx(0.47, abs=0.003)
    arm_x[0] = 0.55  # on its way: more than 3 cm now, but no room yet
    run(obstacles, 1.0, gap_m, arm_stands=False)
    assert x_of(obstacles) == pytest.approx(0.47, abs=0.003)
    arm_x[0] = 0.58
    run(obstacles, 1.0, gap_m, arm_stands=False)
    assert x_of(obstacles) > 0.6  # it had room, waits no more, and a moving arm stops nobody


@pytest.mark.parametrize(
    ("ask", "code"),
    [
        (lambda o: o.add("hand", "box", [1, 1, 1], ORIGIN, None), "duplicate_id"),
        (lambda o: o.add("", "box", [1, 1, 1], ORIGIN, None), "bad_request"),
        (lambda o: o.add("table", "box", [1, 1, 1], ORIGIN, None), "bad_request"),
        (lambda o: o.add("m", "mesh", [1, 1, 1], ORIGIN, None), "unsupported_shape"),
        (lambda o: o.add("m", None, [1, 1, 1], ORIGIN, None), "unsupported_shape"),
        (lambda o: o.add("m", "box", [1, 1], ORIGIN, None), "bad_request"),
        (lambda o: o.add("m", "box", None, ORIGIN, None), "bad_request"),
        (lambda o: o.add("m", "sphere", [0.0], ORIGIN, None), "bad_request"),
        (lambda o: o.add("m", "sphere", [math.nan], ORIGIN, None), "bad_request"),
        (lambda o: o.add("m", "sphere", [0.1], ORIGIN, [math.inf, 0, 0]), "bad_request"),
        (lambda o: o.move("nobody", ORIGIN, None), "unknown_id"),
        (lambda o: o.remove("nobody"), "unknown_id"),
        (lambda o: o.script("nobody", [Waypoint([0, 0, 0], None, 1, 0)], False), "unknown_id"),
        (lambda o: o.script("hand", [], False), "bad_request"),
        (lambda o: o.script("hand", [Waypoint([0, 0, 0], None, 0.0, 0)], False), "bad_request"),
        (lambda o: o.script("hand", [Waypoint([0, 0, 0], None, math.nan, 0)], False), "bad_request"),
        (lambda o: o.script("hand", [Waypoint([0, 0, 0], None, 1, -1.0)], False), "bad_request"),
        (lambda o: o.script("hand", [Waypoint([0, 0], None, 1, 0)], False), "bad_request"),
        (lambda _: pose_of([0, 0, 0], [0, 0, 0, 0], "p"), "bad_request"),
        (lambda _: pose_of([0, 0, math.nan], None, "p"), "bad_request"),
        (lambda _: pose_of(None, None, "p"), "bad_request"),
        (lambda _: pose_of([0, 0, 0], [0, 0, 1], "p"), "bad_request"),
    ],
)
def test_what_cannot_be_is_refused_and_changes_nothing(ask, code: str) -> None:
    obstacles = book()
    before = obstacles.all()
    with pytest.raises(RequestError) as caught:
        ask(obstacles)
    assert caught.value.code == code
    assert obstacles.all() == before


def test_there_is_a_limit() -> None:
    obstacles = book(max_obstacles=1)
    with pytest.raises(RequestError, match="1 obstacles"):
        obstacles.add("more", "sphere", [0.1], ORIGIN, None)
