"""The demo's state machine, with time and observations as arguments."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count, cycle

from clients.demo.driver import RESEND_AFTER_S, SUDDEN_WAITS_S, Driver, Seen
from clients.demo.script import Act, Goal
from common.wire.messages import SetGoal, SetObstacle

QUIET = Seen({}, None, lambda _: True)


def named_goals() -> Iterator[Goal]:
    regions = cycle(["pick", "place"])
    return (Goal(next(regions), SetGoal(name=f"goal {n}")) for n in count())


def box_every(seconds: float, *, is_sudden: bool = True, life_s: float = 2.0) -> Iterator[Act]:
    for n in count(1):
        yield Act(n * seconds, life_s, (SetObstacle(op="add", id=f"box-{n}"),), is_sudden)


def driver(acts: Iterator[Act] | None = None) -> Driver:
    return Driver(named_goals(), box_every(1000.0) if acts is None else acts, patience_s=30.0)


def name(goal: SetGoal | None) -> str | None:
    return None if goal is None else goal.name


def working_on(goal_id: str) -> Seen:
    return Seen({}, goal_id, lambda _: True)


def test_a_goal_is_sent_once_and_the_next_when_it_is_reached() -> None:
    d = driver()
    assert name(d.step(0.0, QUIET).goal) == "goal 0"
    d.accepted("a", 0.0)
    assert d.step(0.1, working_on("a")).goal is None
    assert name(d.step(5.0, Seen({"a": "goal_reached"}, None, lambda _: True)).goal) == "goal 1"
    assert (d.tally.reached, d.tally.cycles) == (1, 0)
    d.accepted("b", 5.0)
    d.step(9.0, Seen({"b": "goal_reached"}, None, lambda _: True))
    assert (d.tally.reached, d.tally.cycles) == (2, 1)


def test_the_end_of_another_goal_means_nothing() -> None:
    d = driver()
    d.step(0.0, QUIET)
    d.accepted("a", 0.0)
    assert d.step(0.5, Seen({"x": "goal_reached"}, "a", lambda _: True)).goal is None
    assert d.tally.reached == 0


def test_a_goal_that_fails_or_lasts_too_long_is_given_up() -> None:
    d = driver()
    d.step(0.0, QUIET)
    d.accepted("a", 0.0)
    assert name(d.step(1.0, Seen({"a": "goal_failed"}, None, lambda _: True)).goal) == "goal 1"
    d.accepted("b", 1.0)
    for tenth in range(10, 310):
        assert d.step(tenth / 10.0, working_on("b")).goal is None
    assert name(d.step(31.1, working_on("b")).goal) == "goal 2"
    assert d.tally.given_up == 2


def test_a_refused_goal_makes_way_for_the_next() -> None:
    d = driver()
    assert name(d.step(0.0, QUIET).goal) == "goal 0"
    d.refused()
    assert name(d.step(0.1, QUIET).goal) == "goal 1"


def test_a_planner_that_forgot_the_goal_is_told_again() -> None:
    d = driver()
    d.step(0.0, QUIET)
    d.accepted("a", 0.0)
    assert d.step(2.0, working_on("a")).goal is None
    assert d.step(2.0 + RESEND_AFTER_S, QUIET).goal is None
    assert name(d.step(2.1 + RESEND_AFTER_S, QUIET).goal) == "goal 0"
    assert d.tally.resent == 1


def test_obstacles_appear_in_time_and_vanish_after_their_life() -> None:
    d = driver(box_every(10.0))
    assert d.step(9.9, QUIET).obstacles == ()
    assert [(o.op, o.id) for o in d.step(10.0, QUIET).obstacles] == [("add", "box-1")]
    assert d.step(11.9, QUIET).obstacles == ()
    assert [(o.op, o.id) for o in d.step(12.0, QUIET).obstacles] == [("remove", "box-1")]


def test_a_sudden_obstacle_waits_for_a_fair_moment_and_is_left_out_without_one() -> None:
    unfair = Seen({}, None, lambda _: False)
    d = driver(box_every(10.0))
    assert d.step(10.0, unfair).obstacles == ()
    assert [o.id for o in d.step(10.5, QUIET).obstacles] == ["box-1"]
    d = driver(box_every(10.0))
    assert d.step(10.0 + SUDDEN_WAITS_S, unfair).obstacles == ()
    assert d.tally.obstacles_left_out == 1
    assert d.step(15.0, QUIET).obstacles == (), "its time is over"


def test_a_hand_does_not_ask_for_fairness() -> None:
    d = driver(box_every(10.0, is_sudden=False))
    assert [o.id for o in d.step(10.0, Seen({}, None, lambda _: False)).obstacles] == ["box-1"]
