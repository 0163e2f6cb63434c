"""Answers to the questions of a set, by the map alone or by all ways, as a live planner gives them."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.questions import Question
from common.errors import TolmanError
from services.planner.assemble import Parts
from services.planner.core.found import NotFound, Way
from services.planner.core.motion import Ask, Motion, Stopwatch
from services.planner.core.ways import Sampler, Thinking, ThinkingRules, think
from services.planner.core.world import World
from services.planner.fallback.process import FallbackProcess

__all__ = ["Answer", "Answerer", "fallback_of", "percentiles"]

F64 = NDArray[np.float64]
NO_CELLS = np.empty(0, dtype=np.int32)
READY_WITHIN_S = 300.0  # the first start on a machine compiles


@dataclass(frozen=True, eq=False)
class Answer:
    """A motion or why there is none, milliseconds by stage, and which way it was; the map's own search has no stage ``repair``.

    ``refined``: the second answer, which is the first where nothing better was found, ``ms["refined"]`` after the cells changed.
    """

    motion: Motion | NotFound
    ms: dict[str, float]
    refined: Motion | None = None

    @property
    def way(self) -> str | None:
        """None: it was not solved."""
        return self.motion.path.way if isinstance(self.motion, Motion) else None


class Answerer:
    """Answers on one map, as one planner that runs; each question comes into an empty world, in which its cells appear.

    Args:
        parts: map, robot, config.
        sampler: puts questions to the fallback; None: there is none.
        ways: which are asked; None: as configured.
    """

    def __init__(self, parts: Parts, sampler: Sampler | None, ways: Sequence[Way] | None = None) -> None:
        self._parts, self._sampler = parts, sampler
        self._planner = parts.motion_planner()
        self._counts = parts.roadmap.counts(parts.grid)
        ways = [way for way in ways or parts.config.ways if way != "fallback" or sampler is not None]
        self._rules = replace(ThinkingRules.of(parts.config), ways=ways)

    def answer(self, question: Question) -> Answer:
        """The answer to a question."""
        config = self._parts.config
        counts = self._counts
        counts.set_cells(NO_CELLS)
        watch = Stopwatch(time.perf_counter_ns)
        began = watch.clock_ns()
        counts.set_cells(question.cells)
        world = World.of(self._parts.grid, counts)
        watch.add("update", began)
        ask = Ask(question.q_start, question.q_goal, None, config.rules, config.search, config.smoothing.smooth)
        motion = self._planner.answer(world, ask, watch)
        if isinstance(motion, NotFound) and motion.outcome == "no_path" and config.rules == "checked":
            thinking = Thinking(self._planner, world, ask, question.q_goal[None], self._rules, motion.reason)
            motion = think(thinking, world, watch, self._sampler)
        watch.add("answer", began)
        thought_ms = watch.ms.get("repair", 0.0) + watch.ms.get("fallback", 0.0)  # side by side in part, so rather too much
        watch.ms["connect_search"] = watch.ms["update"] + watch.ms["search"] + thought_ms
        if not isinstance(motion, Motion):
            return Answer(motion, watch.ms)
        refined = self._planner.refined(world, ask, motion, watch)
        watch.add("refined", began)
        return Answer(motion, watch.ms, refined)


@contextmanager
def fallback_of(parts: Parts) -> Iterator[Sampler | None]:
    """The fallback's process, ready, if the config has that way; ended on leaving.

    Raises:
        TolmanError: it does not start.
    """
    if "fallback" not in parts.config.ways:
        yield None
        return
    process = FallbackProcess(parts.cell, parts.config.margins)
    try:
        if not process.wait_ready(READY_WITHIN_S):
            raise TolmanError(f"the fallback process was not ready within {READY_WITHIN_S:g} s", code="no_fallback")
        yield process.send
    finally:
        process.close()


def percentiles(values: list[float]) -> dict[str, float]:
    """p50, p95, p99 and the largest of one value at least."""
    p50, p95, p99 = np.percentile(values, [50, 95, 99])
    return {"p50": round(float(p50), 3), "p95": round(float(p95), 3), "p99": round(float(p99), 3), "max": round(max(values), 3)}
