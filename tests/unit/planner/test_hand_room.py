"""How much room a hand gets: what it may have done since it was seen, and how late that is."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from services.planner.core.check import HandReach
from services.planner.core.seeing_lag import FRAMES, SeeingLag
from services.planner.core.timing import Limits, time_polyline
from services.planner.core.world import cells_of

LIMITS = Limits(np.array([2.16, 2.16, 3.15, 3.2, 3.2, 3.2]), np.full(6, 5.0))


def test_lag_is_the_gap_between_exposures_and_the_frames_age() -> None:
    lag = SeeingLag()
    assert lag.longest_s == 0.0
    lag.hear(0.05, 0.0)
    assert lag.longest_s == pytest.approx(0.05)
    lag.hear(0.12, 0.066)
    assert lag.longest_s == pytest.approx(0.066 + 0.054)


def test_a_slow_moment_is_remembered_for_some_frames_and_then_forgotten() -> None:
    lag = SeeingLag()
    for k in range(20):
        late_s = 0.3 if k == 5 else 0.05
        lag.hear(k / 15 + late_s, k / 15)
        expected = 0.3 + 1 / 15 if 5 <= k < 5 + FRAMES else 0.05 + (1 / 15 if k else 0.0)
        assert lag.longest_s == pytest.approx(expected)


def test_exposures_that_go_backwards_or_come_early_count_as_no_lag() -> None:
    lag = SeeingLag()
    lag.hear(1.0, 1.0)
    lag.hear(1.0, 0.5)
    lag.hear(0.4, 0.6)
    assert lag.longest_s == pytest.approx(0.5)


def test_what_was_seen_longer_ago_and_later_gets_more_room(bench) -> None:
    """Beside the way of the tool lies a hand: fresh eyes may pass it, old ones may not."""
    start = bench.robot.home_rad
    way = np.stack([start, start + np.array([0.6, 0.0, 0.0, 0.0, 0.0, 0.0])])
    timed = time_polyline(way, LIMITS)
    assert timed is not None
    tool = bench.robot.tool_pose(start)[:3, 3]
    fresh = HandReach(0.25, 0.15, LIMITS.acceleration)
    changed = 0
    for away_m in np.arange(0.08, 0.30, 0.02):
        cells = cells_of(bench.grid, bench.grid.cells_of((tool + np.array([away_m, 0.0, 0.0]))[None]).astype(np.int32))
        meets = [
            bench.checker.hand_meets(cells, timed[0], hand) is not None
            for hand in (fresh, dataclasses.replace(fresh, since_seen_s=0.2), dataclasses.replace(fresh, since_seen_s=0.2, latency_s=0.4))
        ]
        assert meets == sorted(meets), "older eyes never need less room"
        changed += meets[0] != meets[2]
    assert changed > 0
