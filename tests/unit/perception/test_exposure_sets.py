"""Which exposures are fused together, and which are refused."""

from __future__ import annotations

import pytest

from services.perception.core.exposure_sets import ExposureSets, Refusal, TimedExposure

MS = 1_000_000
NAMES = ["a", "b", "c"]
T0 = 10_000 * MS


def sets() -> ExposureSets[int]:
    return ExposureSets(NAMES, tolerance_s=0.010, deadline_s=0.020, max_age_s=0.25)


def names(taken: list[TimedExposure[int]] | None) -> list[str] | None:
    return None if taken is None else [e.camera for e in taken]


def add(s: ExposureSets[int], camera: str, exposure_ms: float, now_ms: float) -> Refusal | None:
    return s.add(TimedExposure(camera, T0 + int(exposure_ms * MS), 0), T0 + int(now_ms * MS))


def take(s: ExposureSets[int], now_ms: float) -> list[str] | None:
    return names(s.take(T0 + int(now_ms * MS)))


def test_a_complete_set_is_fused_at_once() -> None:
    s = sets()
    for camera in "bca":
        assert take(s, 25) is None
        assert add(s, camera, 0, 25) is None
    assert take(s, 25) == ["a", "b", "c"]
    assert take(s, 26) is None
    assert s.next_deadline_ns is None


def test_an_incomplete_set_is_fused_at_its_deadline_and_not_before() -> None:
    s = sets()
    add(s, "a", 0, 25)
    add(s, "b", 1, 30)
    assert s.next_deadline_ns == T0 + 45 * MS
    assert take(s, 44) is None
    assert take(s, 45) == ["a", "b"]
    assert add(s, "c", 0, 46) == "too_late"


def test_the_next_instant_closes_an_incomplete_set() -> None:
    s = sets()
    add(s, "a", 0, 25)
    add(s, "a", 33, 40)
    assert take(s, 40) == ["a"]
    add(s, "b", 33, 41)
    add(s, "c", 34, 42)
    assert take(s, 42) == ["a", "b", "c"]


def test_when_two_sets_wait_the_newer_one_is_fused() -> None:
    s = sets()
    add(s, "a", 0, 25)
    add(s, "a", 66, 80)
    add(s, "a", 132, 150)
    assert take(s, 171) == ["a"]
    assert take(s, 171) is None
    assert s.n_skipped == 2


@pytest.mark.parametrize(
    ("camera", "exposure_ms", "expected"),
    [("nobody", 0, "unknown_camera"), ("a", 50, "from_the_future"), ("a", -300, "too_old"), ("a", -200, None), ("a", 9, None)],
)
def test_what_is_refused(camera: str, exposure_ms: float, expected: str | None) -> None:
    assert add(sets(), camera, exposure_ms, 0) == expected


def test_a_set_that_grew_old_while_waiting_is_not_fused() -> None:
    s = sets()
    add(s, "a", 0, 10)
    assert take(s, 260) is None


def test_after_a_restart_earlier_stamps_are_taken_again() -> None:
    s = sets()
    for camera in NAMES:
        add(s, camera, 100, 110)
    assert take(s, 110) == NAMES
    assert add(s, "a", 50, 120) == "too_late"
    s.restart()
    assert add(s, "a", 50, 120) is None
