"""Between the planner's loop and the fallback process: the loop's one question goes out, its answer comes in, and nobody waits."""

from __future__ import annotations

import queue
from collections.abc import Callable
from contextlib import suppress
from functools import partial

from common.robot.payload import Payload
from services.planner.core.thinker import Thinker
from services.planner.core.ways import SamplingAnswer, SamplingQuestion
from services.planner.fallback.process import FallbackProcess

__all__ = ["Courier"]


class Courier:
    """Carries for one :class:`~services.planner.core.thinker.Thinker`.

    Args:
        process: answers.
        wake: called, in a thread of the process's, when an answer is there.

    Attributes:
        held: what the arm holds that is asked for.
    """

    def __init__(self, process: FallbackProcess, wake: Callable[[], None]) -> None:
        self._process, self._wake = process, wake
        self._answers: queue.SimpleQueue[tuple[SamplingQuestion, SamplingAnswer]] = queue.SimpleQueue()
        self._asked: tuple[SamplingQuestion, int] | None = None
        self.held: Payload | None = None

    def bring(self, thinker: Thinker) -> None:
        """Give what was answered."""
        with suppress(queue.Empty):
            while True:
                thinker.hear(*self._answers.get_nowait())

    def fetch(self, thinker: Thinker) -> None:
        """Take the question that is wanted now; one that is wanted no more is withdrawn."""
        wanted = thinker.question
        if self._asked is not None and self._asked[0] is not wanted:
            self._process.withdraw(self._asked[1])
            self._asked = None
        if wanted is not None and self._asked is None:
            self._asked = (wanted, self._process.ask(wanted, partial(self._take, wanted), self.held))

    def _take(self, question: SamplingQuestion, answer: SamplingAnswer) -> None:
        self._answers.put((question, answer))
        self._wake()
