"""Commands are answered: at once, or, where they are questions, one after the other in a thread of their own."""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from common.bus.channels import Command
from common.bus.service import Vitals
from common.clock import monotonic_ns
from common.errors import RequestError, TolmanError
from common.wire.messages import PlanReply, PlanRequest
from services.planner.questions import QuestionDesk

__all__ = ["QUESTIONS_WAITING", "QuestionWorker", "reply_to"]

log = logging.getLogger("planner")
Learn = Callable[[str | None, NDArray[np.float64], NDArray[np.int32], str], None]  # way, path (P, J), cells (C,) it was found in, label
QUESTIONS_WAITING = 16  # our choice; more are answered "busy"


def reply_to(command: Command[Any], action: Callable[[Any], Any]) -> None:
    """Answer a command with what ``action`` makes of its request, or with the error that it raises."""
    try:
        command.reply(action(command.request))
    except TolmanError as error:
        command.fail(error)


class QuestionWorker:
    """A thread that answers questions one by one from a bounded queue."""

    def __init__(self, desk: QuestionDesk, vitals: Vitals, learn: Learn) -> None:
        self.desk = desk  # may be exchanged at any time: the next question goes to the new one
        self._learn = learn
        self._vitals = vitals
        self._waiting: queue.Queue[tuple[Command[PlanRequest], Any, Any] | None] = queue.Queue(QUESTIONS_WAITING)
        self._thread = threading.Thread(target=self._run, name="questions", daemon=True)
        self._thread.start()

    def offer(self, command: Command[PlanRequest], q_now: Any, cells: Any) -> bool:
        """Take a question if there is room."""
        try:
            self._waiting.put_nowait((command, q_now, cells))
        except queue.Full:
            return False
        return True

    def close(self) -> None:
        """Answer no more."""
        self._waiting.put(None)
        self._thread.join(timeout=2.0)

    def _run(self) -> None:
        while (item := self._waiting.get()) is not None:
            command, q_now, cells = item
            began_ns = monotonic_ns()
            try:
                reply_to(command, partial(self._replied, q_now=q_now, live_cells=cells))
            except Exception:  # a question may never end the desk
                log.exception("a question failed")
                command.fail(RequestError("the planner could not answer this; see its log", code="internal"))
            now_ns = monotonic_ns()
            self._vitals.meter("questions").tick(now_ns, (now_ns - began_ns) / 1e6)

    def _replied(self, request: PlanRequest, q_now: Any, live_cells: Any) -> PlanReply:
        reply = self.desk.answer(request, q_now, live_cells)
        self._learn(reply.way, reply.path_q_rad, live_cells if request.cells is None else request.cells, "a question")
        return reply
