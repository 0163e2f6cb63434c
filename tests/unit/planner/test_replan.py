from __future__ import annotations

import numpy as np
import pytest

from services.planner.core.replan import Action, ReplanRules, ShorterWay, View

BASE = {
    "now_s": 10.0, "has_goal": True, "seeing": True, "moving": False, "stopping": False, "at_goal": False, "to_other_goal": False,
    "blocked_in_s": None, "stop_needs_s": 0.4, "cells_changed": False, "protective": "",
}  # fmt: skip


def decide(rules=None, **change):
    return (rules or ReplanRules(0.3)).decide(View(**{**BASE, **change}))


@pytest.mark.parametrize(
    ("change", "action"),
    [
        ({"has_goal": False}, Action.NOTHING),
        ({"has_goal": False, "moving": True}, Action.STOP),
        ({}, Action.PLAN),
        ({"seeing": False}, Action.NOTHING),
        ({"at_goal": True}, Action.ARRIVED),
        ({"at_goal": True, "seeing": False}, Action.ARRIVED),
        ({"protective": "x"}, Action.NOTHING),
        ({"protective": "x", "moving": True}, Action.STOP),
        ({"moving": True}, Action.COMPARE),
        ({"moving": True, "stopping": True, "blocked_in_s": 0.1}, Action.NOTHING),
        ({"moving": True, "stopping": True, "has_goal": False}, Action.NOTHING),
        ({"moving": True, "blocked_in_s": 2.0, "cells_changed": True}, Action.DODGE),
        ({"moving": True, "blocked_in_s": 0.1, "cells_changed": True}, Action.DODGE),
        ({"moving": True, "to_other_goal": True}, Action.DODGE),
        ({"moving": True, "seeing": False, "blocked_in_s": 0.1}, Action.NOTHING),
        ({"faulted": True}, Action.NOTHING),
        ({"faulted": True, "moving": True, "has_goal": False}, Action.NOTHING),
    ],
)
def test_first_decision(change, action):
    assert decide(**change) is action


def test_attempts_come_at_ticks_and_at_changes_only():
    rules = ReplanRules(0.3)
    assert decide(rules) is Action.PLAN
    assert decide(rules, now_s=10.1) is Action.NOTHING
    assert decide(rules, now_s=10.2, cells_changed=True) is Action.PLAN
    assert decide(rules, now_s=10.4) is Action.NOTHING
    assert decide(rules, now_s=10.51) is Action.PLAN
    rules.now_or_never()
    assert decide(rules, now_s=10.52) is Action.PLAN


def test_a_way_that_stays_blocked_is_left_when_it_gets_near():
    rules = ReplanRules(0.3)
    far, near = {"moving": True, "blocked_in_s": 2.0}, {"moving": True, "blocked_in_s": 0.3}
    assert decide(rules, cells_changed=True, **far) is Action.DODGE
    assert rules.after_failed_dodge(View(**{**BASE, **far})) is Action.NOTHING
    assert decide(rules, now_s=10.1, **far) is Action.NOTHING
    assert decide(rules, now_s=10.2, **near) is Action.STOP
    assert rules.after_failed_dodge(View(**{**BASE, **near})) is Action.STOP


def test_a_motion_to_another_goal_is_stopped_when_there_is_no_way_to_the_new_one():
    assert ReplanRules(0.3).after_failed_dodge(View(**{**BASE, "moving": True, "to_other_goal": True})) is Action.STOP


def shorter():
    return ShorterWay(share=0.05, least_rad=0.1, stable_s=1.0, corridor_rad=0.5)


def test_shorter_must_be_shorter_by_both_measures():
    middle = np.zeros(6)
    way = shorter()
    assert not way.offer(0.0, 0.95, 1.0, middle) and not way.offer(2.0, 0.95, 1.0, middle)  # 0.05 rad is less than 0.1
    assert not way.offer(3.0, 9.7, 10.0, middle) and not way.offer(5.0, 9.7, 10.0, middle)  # 3 % is less than 5 %


def test_shorter_must_last_a_second_in_the_same_corridor():
    way, here, there = shorter(), np.zeros(6), np.full(6, 1.0)
    assert not way.offer(0.0, 1.0, 2.0, here)
    assert not way.offer(0.9, 1.0, 2.0, here)
    assert way.offer(1.0, 1.0, 2.0, here)
    way.forget()
    assert not way.offer(0.0, 1.0, 2.0, here)
    assert not way.offer(0.9, 1.0, 2.0, there)  # another corridor: the second begins anew
    assert not way.offer(1.2, 1.0, 2.0, there)
    assert way.offer(2.0, 1.0, 2.0, there)


def test_a_moment_without_a_shorter_way_begins_anew():
    way, here = shorter(), np.zeros(6)
    assert not way.offer(0.0, 1.0, 2.0, here)
    assert not way.offer(0.5, 2.0, 2.0, here)
    assert not way.offer(1.0, 1.0, 2.0, here)
    assert way.offer(2.0, 1.0, 2.0, here)
