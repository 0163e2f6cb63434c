from __future__ import annotations

from services.robot_sim.core.contacts import ContactLog, Touch

MS = 1_000_000


def touch(approach_m_s: float, part: str = "forearm", other: str = "hand", blameless: bool = True) -> Touch:
    return Touch(part, other, blameless, approach_m_s)


def test_first_touch_decides_who_caused_it() -> None:
    log = ContactLog(0.5, 0.01)
    (begun,) = log.observe(0, [touch(0.009), touch(0.001, part="wrist")])
    assert begun.touch.part == "forearm" and not begun.is_caused
    assert not log.observe(8 * MS, [touch(1.0)])  # the arm pushes later: the event is what it was
    assert (log.caused, log.suffered) == (0, 1)
    log.observe(0, [touch(0.011, other="box")])
    assert (log.caused, log.suffered) == (1, 1)


def test_gaps_below_half_a_second_are_one_event() -> None:
    log = ContactLog(0.5, 0.01)
    for at in (0, 400, 899):  # each less than 500 ms after the one before
        log.observe(at * MS, [touch(0.0)])
        log.observe((at + 1) * MS, [])
    assert log.suffered == 1
    log.observe(1399 * MS, [touch(0.0, part="wrist")])
    assert log.suffered == 2
    assert list(log.pairs) == [("forearm", "hand"), ("wrist", "hand")]


def test_table_bins_and_self_are_always_caused() -> None:
    log = ContactLog(0.5, 0.01)
    log.observe(0, [touch(-1.0, other="table", blameless=False), touch(0.0, other="upper_arm", blameless=False)])
    assert (log.caused, log.suffered) == (2, 0)
    log.reset()
    assert (log.caused, log.suffered, log.pairs) == (0, 0, {})
