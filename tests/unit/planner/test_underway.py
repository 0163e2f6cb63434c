"""What is under way as the robot tells it."""

from __future__ import annotations

import numpy as np

from common.robot.trajectory import JointTrajectory
from services.planner.core.underway import ACCEPT_WITHIN_S, ArmState, Sent, Underway

CURVE = JointTrajectory(np.array([0.0, 1.0]), np.array([[0.0], [0.1]]), np.zeros((2, 1)))


def _sent(name: str, sent_s: float) -> Sent:
    return Sent(name, "motion", "goal", CURVE, sent_s, sent_s, None, None, "none", 0, None)


def _arm(at_s: float, trajectory_id: str, refused_id: str = "", *, standing: bool = False) -> ArmState:
    q = np.zeros(1)
    return ArmState(at_s, q, q, standing, "holding" if standing else "tracking", "", trajectory_id, 0.0, 0, refused_id)


def test_a_refusal_brings_the_one_before_back_at_once() -> None:
    underway = Underway()
    underway.send(_sent("a", 0.0))
    assert underway.hear(_arm(0.01, "a"), 0.01) is underway.sent
    underway.send(_sent("b", 0.1))
    assert underway.hear(_arm(0.11, "a"), 0.11) is None and underway.sent is not None and underway.sent.id == "b"
    underway.hear(_arm(0.12, "a", refused_id="b"), 0.12)
    assert underway.sent is not None and underway.sent.id == "a"


def test_an_old_refusal_says_nothing_of_a_new_trajectory() -> None:
    underway = Underway()
    underway.send(_sent("c", 0.0))
    underway.hear(_arm(0.01, "a", refused_id="b", standing=True), 0.01)
    assert underway.sent is not None and underway.sent.id == "c"


def test_a_trajectory_of_which_nothing_is_heard_is_lost_after_a_while() -> None:
    underway = Underway()
    underway.send(_sent("a", 0.0))
    underway.hear(_arm(ACCEPT_WITHIN_S, "", standing=True), ACCEPT_WITHIN_S)
    assert underway.sent is not None
    underway.hear(_arm(ACCEPT_WITHIN_S + 0.01, "", standing=True), ACCEPT_WITHIN_S + 0.01)
    assert underway.sent is None
