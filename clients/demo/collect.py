"""Gathers the demo's figures from what passes on the bus. Knows messages and numbers, not the bus."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from clients.demo.arm import Arm
from clients.demo.driver import Tally
from common.wire.messages import Clearance, Message, PlannerEvent, PlannerStatus, RobotState, ServiceHealth

__all__ = ["Collector", "percentiles"]

SAMPLE_GAP_NS = 40_000_000  # our choice: a quarter of a second's motion in six samples is enough for a median
SAMPLES_KEPT = 100_000  # more than an hour of them


def percentiles(values: Iterable[float]) -> dict[str, float] | None:
    """``{p50, p95, p99, n}`` or None without values."""
    kept = np.asarray(list(values), dtype=np.float64)
    if not len(kept):
        return None
    p50, p95, p99 = np.percentile(kept, [50, 95, 99])
    return {"p50": float(p50), "p95": float(p95), "p99": float(p99), "n": len(kept)}


class Collector:
    """Feed it every message; ask it for :meth:`figures` at the end, or in between."""

    def __init__(self) -> None:
        self.events: Counter[str] = Counter()
        self.replans: Counter[str] = Counter()
        self.ways: Counter[str] = Counter()
        self.first_motion_ns: int | None = None
        self._tracking: deque[tuple[Any, Any]] = deque(maxlen=SAMPLES_KEPT)
        self._last_sample_ns = 0
        self._reactions_ms: list[float] = []
        self._timings: list[Mapping[str, float]] = []
        self._last_status: PlannerStatus | None = None

    def observe(self, message: Message) -> None:
        """Take in one message of any channel."""
        if isinstance(message, RobotState):
            self._observe_robot(message)
        elif isinstance(message, PlannerStatus):
            self._observe_status(message)

    def observe_event(self, event: PlannerEvent) -> None:
        """Take in one planner event (a lossless channel: each exactly once)."""
        self.events[event.kind] += 1
        if event.kind == "replanned":
            self.replans[str(event.facts.get("rule", "unknown"))] += 1
            self.ways[str(event.facts.get("way", "unknown"))] += 1

    def _observe_robot(self, state: RobotState) -> None:
        if state.mode != "tracking":
            return
        if self.first_motion_ns is None:
            self.first_motion_ns = state.stamp_ns
        if state.stamp_ns - self._last_sample_ns >= SAMPLE_GAP_NS:
            self._last_sample_ns = state.stamp_ns
            self._tracking.append((state.q_rad, state.dq_rad_s))

    def _observe_status(self, status: PlannerStatus) -> None:
        """A status is sent ten times a second, so only what differs from the one before is a new measurement."""
        before, self._last_status = self._last_status, status
        if status.reaction_ms is not None and (before is None or before.reaction_ms != status.reaction_ms):
            self._reactions_ms.append(status.reaction_ms)
        if status.timing_ms and (before is None or before.timing_ms != status.timing_ms):
            self._timings.append(status.timing_ms)

    def reactions(self) -> dict[str, float] | None:
        """Percentiles of the reactions so far."""
        return percentiles(self._reactions_ms)

    def tool_speed_median_m_s(self, arm: Arm) -> float | None:
        """Median speed of the tool over the samples in mode ``tracking``."""
        if not self._tracking:
            return None
        q_rad, dq_rad_s = (np.array(column) for column in zip(*self._tracking, strict=True))
        return float(np.median(arm.tool_speeds(q_rad, dq_rad_s)))

    def figures(
        self, arm: Arm, tally: Tally, clearance: Clearance, health: Mapping[str, ServiceHealth], rates_hz: Mapping[str, float]
    ) -> dict[str, Any]:
        """The demo's result, without its provenance."""
        stages = sorted({stage for timing in self._timings for stage in timing})
        robot, planner = (health[owner].counters if owner in health else {} for owner in ("robot", "planner"))
        return {
            "cycles": tally.cycles,
            "goals_reached": tally.reached,
            "goals_given_up": tally.given_up,
            "goals_resent": tally.resent,
            "goals_refused": tally.refused,
            "obstacles_shown": tally.obstacles_shown,
            "contacts_caused": clearance.contacts_caused,
            "contacts_suffered": clearance.contacts_suffered,
            "contact_pairs": clearance.contact_pairs,
            "min_distance_m": clearance.min_distance_since_reset_m,
            "min_obstacle_distance_m": clearance.min_obstacle_distance_since_reset_m,
            "tool_speed_median_m_s": self.tool_speed_median_m_s(arm),
            "replans": dict(self.replans),
            "ways": dict(self.ways),
            "stops": self.events["stopped"],
            "events": dict(self.events),
            "reaction_ms": self.reactions(),
            "timing_ms": {stage: percentiles(t[stage] for t in self._timings if stage in t) for stage in stages},
            "rates_hz": dict(rates_hz),
            "tracking_error_max_rad": clearance.tracking_error_max_rad,
            "slipped_steps": robot.get("slipped_steps", 0),
            "smoothing_fallbacks": planner.get("smoothing_fallbacks", 0),
            "counters": {owner: dict(value.counters) for owner, value in health.items()},
            "latency_ms": {owner: value.latency_ms for owner, value in health.items()},
        }
