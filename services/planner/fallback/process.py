"""The fallback process as the planner has it: started, asked, started again when it dies or says nothing, ended with the planner.

Nothing here waits for the process: questions go through a thread that may block on the pipe, answers come from another. A question that
was under way when the process died is asked once more, of the next process: the same question, so the same answer.
"""

from __future__ import annotations

import logging
import queue
import select
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from common.cell import CellConfig
from common.robot.payload import Payload
from services.planner.config import MarginsConfig
from services.planner.core.ways import Sampler, SamplingAnswer, SamplingQuestion
from services.planner.fallback.carried_map import pack
from services.planner.fallback.frames import Answer, Asked, Held, Ready, Setting, Withdrawn, read_frame, write_frame

__all__ = ["FallbackProcess", "Sent"]

log = logging.getLogger("planner")
SILENT_S = 30.0  # a process at work says so each second, however long its work is, so one that is silent for longer hangs; our choice
START_WITHIN_S = 300.0  # the first start on a machine compiles
TRIES = 2  # processes that a question is put to
RESTART_S, RESTART_MAX_S = 0.5, 10.0  # after an end; doubled with each that came before it was ready
LOOK_S = 0.2  # between two looks at the clock
END_WITHIN_S = 2.0
OnAnswer = Callable[[SamplingAnswer], None]


@dataclass(eq=False)
class _Pending:
    question: SamplingQuestion
    on_answer: OnAnswer
    since_s: float
    held: Payload | None
    tries: int = 1


class FallbackProcess:
    """One process behind a pipe.

    Args:
        cell, margins: what the arm moves in.
        start: the command; another one in tests.
    """

    def __init__(self, cell: CellConfig, margins: MarginsConfig, command: list[str] | None = None) -> None:
        self._setting = Setting(cell, margins)
        self._command = command or [sys.executable, "-m", "services.planner.fallback.worker"]
        self._lock = threading.Lock()
        self._pending: dict[int, _Pending] = {}
        self._n_asked = 0
        self._closing = threading.Event()
        self._ready = threading.Event()
        self._heard_s = -np.inf
        self._child: subprocess.Popen[bytes] | None = None
        self.restarts = 0
        self._thread = threading.Thread(target=self._keep_alive, name="fallback", daemon=True)
        self._thread.start()

    @property
    def pid(self) -> int | None:
        """Of the process that runs now."""
        child = self._child
        return None if child is None else child.pid

    def wait_ready(self, timeout_s: float) -> bool:
        """Whether it answers within the time; for who measures it."""
        return self._ready.wait(timeout_s)

    def ask(self, question: SamplingQuestion, on_answer: OnAnswer, held: Payload | None = None) -> int:
        """Put a question for an arm that holds ``held``.

        ``on_answer`` is called once, in a thread of this object, whatever becomes of the process.
        """
        with self._lock:
            self._n_asked += 1
            number = self._n_asked
            self._pending[number] = _Pending(question, on_answer, time.monotonic(), held)
            if self._ready.is_set():
                self._out.put(partial(_asked, number, question, held))
        return number

    def send(self, question: SamplingQuestion, held: Payload | None = None) -> Sent:
        """The same for who has time to wait; never for longer than a process is given."""
        answers: queue.SimpleQueue[SamplingAnswer] = queue.SimpleQueue()
        return Sent(self, self.ask(question, answers.put, held), answers)

    def sampler(self, held: Payload | None) -> Sampler:
        """:meth:`send` for an arm that holds ``held``."""
        return partial(self.send, held=held)

    def withdraw(self, number: int) -> None:
        """The answer is not wanted any more and will not come."""
        with self._lock:
            if self._pending.pop(number, None) is not None and self._ready.is_set():
                self._out.put(Withdrawn(number))

    def close(self) -> None:
        """End the process; what is pending is answered with nothing."""
        self._closing.set()
        self._end_child()
        self._thread.join(2.0 * END_WITHIN_S)

    # --- the thread that keeps a process running ---

    def _keep_alive(self) -> None:
        wait_s = RESTART_S
        while not self._closing.is_set():
            was_ready = self._run_once()
            wait_s = RESTART_S if was_ready else min(2.0 * wait_s, RESTART_MAX_S)
            self._after_an_end()
            self._closing.wait(wait_s)
        self._answer_all("the planner ends")

    def _run_once(self) -> bool:
        """One process from start to end; whether it ever was ready."""
        self._out: queue.SimpleQueue[Any] = queue.SimpleQueue()
        try:
            self._child = child = subprocess.Popen(self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        except OSError as error:
            log.warning("the fallback process cannot be started: %s", error)
            return False
        if self._closing.is_set():
            self._end_child()
        writer = threading.Thread(target=_write_all, args=(child.stdin, self._out), name="fallback-out", daemon=True)
        writer.start()
        self._out.put(self._setting)
        answers = child.stdout
        assert answers is not None
        began_s = time.monotonic()
        while True:
            if select.select([answers], [], [], LOOK_S)[0]:
                frame = read_frame(answers)
                if frame is None:
                    break
                self._hear(frame)
            if self._is_overdue(began_s):
                log.warning("the fallback process says nothing and is ended")
                child.kill()
        was_ready = self._ready.is_set()
        with self._lock:
            self._ready.clear()
            self._out.put(None)
        child.kill()
        child.wait()
        writer.join()
        answers.close()
        return was_ready

    def _hear(self, frame: Any) -> None:
        self._heard_s = time.monotonic()
        if isinstance(frame, Ready):
            with self._lock:
                self._ready.set()
                for number, pending in self._pending.items():
                    pending.since_s = time.monotonic()
                    self._out.put(partial(_asked, number, pending.question, pending.held))
        elif isinstance(frame, Answer):
            with self._lock:
                pending_ = self._pending.pop(frame.id, None)
            if pending_ is not None:
                q_rad = None if frame.q_rad is None else np.array(frame.q_rad)
                why = "" if q_rad is not None else f"the sampling planner found no way in {frame.iterations} samples"
                pending_.on_answer(SamplingAnswer(q_rad, why, frame.iterations, frame.ms))

    def _is_overdue(self, began_s: float) -> bool:
        """Whether the process must be ended; questions that wait for one that is not ready are answered here."""
        now_s = time.monotonic()
        with self._lock:
            overdue = [number for number, pending in self._pending.items() if now_s - pending.since_s > SILENT_S]
            if self._ready.is_set():
                return bool(overdue) and now_s - self._heard_s > SILENT_S
            late = [self._pending.pop(number) for number in overdue]
        for pending in late:
            pending.on_answer(SamplingAnswer(None, "the fallback process is not ready", 0, 0.0))
        return now_s - began_s > START_WITHIN_S

    def _after_an_end(self) -> None:
        """Questions that two processes did not survive are answered; the others wait for the next one."""
        if self._closing.is_set():
            return
        self.restarts += 1
        log.warning("the fallback process ended; it is started again")
        with self._lock:
            given_up = [number for number, pending in self._pending.items() if pending.tries >= TRIES]
            lost = [self._pending.pop(number) for number in given_up]
            for pending in self._pending.values():
                pending.tries += 1
        for pending in lost:
            pending.on_answer(SamplingAnswer(None, "the fallback process did not survive the question", 0, 0.0))

    def _answer_all(self, why: str) -> None:
        with self._lock:
            pending, self._pending = self._pending, {}
        for one in pending.values():
            one.on_answer(SamplingAnswer(None, why, 0, 0.0))

    def _end_child(self) -> None:
        child = self._child
        if child is None:
            return
        with self._lock, suppress(AttributeError):
            self._out.put(None)  # the writer closes the pipe, and with that the process ends
        with suppress(subprocess.TimeoutExpired):
            child.wait(END_WITHIN_S)
            return
        child.kill()


class Sent:
    """A question on its way: an :class:`~services.planner.core.ways.Errand`."""

    def __init__(self, process: FallbackProcess, number: int, answers: queue.SimpleQueue[SamplingAnswer]) -> None:
        self._process, self._number, self._answers = process, number, answers

    def wait(self) -> SamplingAnswer:
        """The answer; once."""
        return self._answers.get()

    def withdraw(self) -> None:
        """It is not wanted any more."""
        self._process.withdraw(self._number)


def _write_all(pipe: Any, out: queue.SimpleQueue[Any]) -> None:
    with suppress(OSError, ValueError):
        while (frame := out.get()) is not None:
            write_frame(pipe, frame() if callable(frame) else frame)  # a map is packed here, where nobody waits for it
    with suppress(OSError):
        pipe.close()


def _asked(number: int, question: SamplingQuestion, held: Payload | None) -> Asked:
    seed: NDArray[np.uint64] = question.seed
    return Asked(
        number,
        question.q_start_rad.tolist(),
        question.q_goals_rad.tolist(),
        np.ascontiguousarray(question.cells, dtype="<i4").tobytes(),
        [int(part) for part in seed],
        question.max_iterations,
        question.n_searches,
        None if held is None else Held(held.size_m, held.position_m, held.quaternion_xyzw),
        None if question.known is None else pack(question.known),
    )
