"""Whatever comes in whatever order: sets are simultaneous, newer than the last, never old, and each exposure is fused at most once."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from services.perception.core.exposure_sets import ExposureSets, TimedExposure

MS = 1_000_000
arrivals = st.lists(st.tuples(st.sampled_from(["a", "b", "c", "x"]), st.integers(-400, 100), st.integers(0, 40)), min_size=1, max_size=60)


@given(arrivals)
def test_sets_keep_their_promises(events: list[tuple[str, int, int]]) -> None:
    sets: ExposureSets[int] = ExposureSets(["a", "b", "c"], tolerance_s=0.010, deadline_s=0.020, max_age_s=0.25)
    now_ms, last_ns, fused = 1000, None, set()
    for number, (camera, offset_ms, wait_ms) in enumerate(events):
        now_ms += wait_ms
        refusal = sets.add(TimedExposure(camera, (now_ms + offset_ms) * MS, number), now_ms * MS)
        if camera == "x":
            assert refusal == "unknown_camera"
        if offset_ms > 10:
            assert refusal is not None
        taken = sets.take(now_ms * MS)
        if taken is None:
            continue
        stamps = [e.exposure_ns for e in taken]
        assert max(stamps) - min(stamps) <= 20 * MS
        assert now_ms * MS - max(stamps) <= 250 * MS
        assert len({e.camera for e in taken}) == len(taken)
        assert last_ns is None or min(stamps) > last_ns
        assert fused.isdisjoint(e.payload for e in taken)
        fused |= {e.payload for e in taken}
        last_ns = max(stamps)
