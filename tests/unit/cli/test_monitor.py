"""What the status table counts."""

from __future__ import annotations

import pytest

from clients.cli.watch import Changes
from clients.monitor import ChannelWatch
from clients.waiting import ending
from common.wire.messages import PlannerEvent

MS = 1_000_000


def event(seq: int, epoch: int = 1, stamp_ns: int = 0) -> PlannerEvent:
    return PlannerEvent(seq=seq, epoch=epoch, stamp_ns=stamp_ns, number=seq, kind="replanned", goal_id="g", facts={})


def test_samples_that_the_inbox_skipped_are_counted() -> None:
    watch = ChannelWatch("robot/state")
    for n in range(0, 126, 5):
        watch.observe(event(n), n * 8 * MS, 0)
    figures = watch.figures(1000 * MS)
    assert figures.total == 126
    assert figures.rate_hz == pytest.approx(125.0)
    assert figures.age_ms == pytest.approx(0.0)
    assert watch.mean_rate_hz() == pytest.approx(125.0)


def test_a_restarted_publisher_counts_on() -> None:
    watch = ChannelWatch("robot/state")
    for seq, epoch in ((10, 1), (11, 1), (1, 2), (3, 2)):
        watch.observe(event(seq, epoch), 0, 0)
    assert watch.total == 1 + 1 + 1 + 2


def test_a_silent_channel_has_no_rate_and_a_growing_age() -> None:
    watch = ChannelWatch("robot/state")
    for n in range(10):
        watch.observe(event(n), n * 8 * MS, 0)
    figures = watch.figures(10_000 * MS)
    assert figures.rate_hz == 0.0
    assert figures.age_ms == pytest.approx(10_000 - 72)


def test_latency_is_from_stamp_to_arrival() -> None:
    watch = ChannelWatch("robot/state")
    utc_minus_monotonic_ns = 5_000 * MS
    watch.observe(event(1, stamp_ns=5_010 * MS), 13 * MS, utc_minus_monotonic_ns)
    assert watch.figures(20 * MS).latency_ms == pytest.approx(3.0)


def test_only_changes_are_told() -> None:
    changes = Changes()
    assert changes.line("robot", ("idle", "")) == "robot    idle"
    assert changes.line("robot", ("idle", "")) is None
    assert changes.line("robot", ("holding", "watchdog")) == "robot    holding watchdog"


def test_the_end_of_one_goal_is_told_from_others() -> None:
    events = [
        PlannerEvent(number=1, kind="goal_reached", goal_id="other", facts={}),
        PlannerEvent(number=2, kind="replanned", goal_id="mine", facts={}),
        PlannerEvent(number=3, kind="goal_failed", goal_id="mine", facts={}),
    ]
    assert [e.number for e in ending("mine", events)] == [3]
