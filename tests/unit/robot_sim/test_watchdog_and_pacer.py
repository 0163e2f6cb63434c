from __future__ import annotations

from services.robot_sim.config import WatchdogConfig
from services.robot_sim.core.pacer import CATCH_UP_CYCLES, Due, Pacer
from services.robot_sim.core.watchdog import Watchdog

MS = 1_000_000


def watchdog(now_ns: int = 0) -> Watchdog:
    dog = Watchdog(WatchdogConfig())
    for owner in ("planner", "perception", "cameras"):
        dog.set_alive(owner, True)
    dog.heard_status(now_ns)
    dog.saw_exposure(now_ns)
    return dog


def test_says_nothing_while_all_is_fresh_and_names_what_is_not() -> None:
    dog = watchdog()
    assert dog.lost(250 * MS) == ""
    assert dog.lost(251 * MS) == "no fresh planner/status for 0.25 s"
    dog.heard_status(251 * MS)
    assert dog.lost(251 * MS) == "no fresh exposure for 0.25 s"
    dog.saw_exposure(251 * MS)
    assert dog.lost(251 * MS) == ""
    dog.saw_exposure(0)  # a camera that lags does not make the newest older
    assert dog.lost(251 * MS) == ""


def test_a_lost_token_counts_at_once_and_strangers_do_not() -> None:
    for owner in ("planner", "perception", "cameras"):
        dog = watchdog()
        dog.set_alive(owner, False)
        assert dog.lost(0) == f"{owner} is not there"
    dog = watchdog()
    dog.set_alive("viewer", False)
    assert dog.lost(0) == ""


def test_nothing_heard_yet_is_lost() -> None:
    assert Watchdog(WatchdogConfig()).lost(0) == "planner is not there"


def test_pacer_keeps_its_rate() -> None:
    pacer = Pacer(125.0, 0)
    assert pacer.due(7 * MS) == Due(0, 0, 0)
    assert pacer.due(8 * MS) == Due(1, 0, 0)
    assert (pacer.advance(), pacer.deadline_ns) == (8 * MS, 16 * MS)


def test_pacer_catches_up_a_little_and_skips_the_rest() -> None:
    pacer = Pacer(125.0, 0)
    assert pacer.due(26 * MS) == Due(3, 2, 0)
    late = 8 * MS + 99 * 8 * MS
    due = pacer.due(late)
    assert due == Due(CATCH_UP_CYCLES, 99, (100 - CATCH_UP_CYCLES) * 8 * MS)
    assert [pacer.advance() for _ in range(due.cycles)][-1] == late
    assert pacer.due(late) == Due(0, 0, 0)
