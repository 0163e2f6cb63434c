"""Learns motions in a thread of its own and hands over grown maps, ready to be exchanged.

Everything that costs time happens here: checking the path, growing map and table, the journal, new scratch buffers, new counts. What is
left to the loop is to exchange references and to count the cells that changed meanwhile (:meth:`Learned.adopt`).
"""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from common.bus.channels import Command
from common.clock import monotonic_ns, utc_ns
from common.errors import ArtefactError, RequestError, TolmanError
from common.wire.messages import LearnReply
from services.planner.assemble import Parts
from services.planner.core.find import PathFinder
from services.planner.core.growth import Addition, grown
from services.planner.core.learning import LearningRules, MotionCheck, check_path, learn, usual_spacing
from services.planner.core.lookup import BlockedCounts
from services.planner.core.reflex import Reflex
from services.planner.core.ways import Sampler
from services.planner.core.world import cells_of, no_cells
from services.planner.memory import Memory
from services.planner.questions import QuestionDesk

__all__ = ["Learned", "Learner", "Lesson", "Student"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
log = logging.getLogger("planner")
MAX_LABEL = 200  # characters; our choice


@dataclass(frozen=True, eq=False)
class Lesson:
    """A joint path (K, J) to learn; ``source`` says where it comes from (``taught``, ``repair``, ...), ``command`` wants the answer.

    ``cells`` (C,): flat indices of those among which it was found; None: it is not known among which.
    """

    q_rad: F64
    t_s: F64 | None = None
    label: str = ""
    source: str = "taught"
    command: Command[Any] | None = None
    cells: I32 | None = None


@dataclass(frozen=True, eq=False)
class Learned:
    """A lesson that was learned: what to exchange (nothing if the map had it all), what to tell."""

    lesson: Lesson
    reply: LearnReply
    parts: Parts
    desk: QuestionDesk | None = None
    finder: PathFinder | None = None
    counts: BlockedCounts | None = None

    @property
    def facts(self) -> dict[str, Any]:
        """For the event ``learned``."""
        told = ("number", "n_neurons", "n_edges", "added_neurons", "added_edges", "seconds")
        about = {"label": self.lesson.label, "source": self.lesson.source}
        return {**about, **{name: getattr(self.reply, name) for name in told}}

    def adopt(self, reflex: Reflex) -> None:
        """Exchange the live planner's map; in the loop's thread. What is under way goes on: its neurons keep their numbers."""
        if self.finder is not None and self.counts is not None:
            self.finder.checker = reflex.checker  # what was in the gripper when the finder was made may be gone
            reflex.planner.finder = self.finder
            reflex.vision.take(self.finder.roadmap, self.counts)


class Student:
    """Takes in one lesson after the other; holds a checker, so one per thread.

    Args:
        memory: the map to begin with and its journal.
        reflex: the live planner; of it only the live cells and its checker are taken, to prepare what is exchanged.
        sampler: for the desk of questions; see there.
    """

    def __init__(self, memory: Memory, reflex: Reflex, sampler: Sampler | None = None) -> None:
        self._sampler = sampler
        self._parts, self._journal, self._complaint = memory.parts, memory.journal, memory.complaint
        self._reflex = reflex
        self._checker = memory.parts.checker()
        self._empty = no_cells(memory.parts.grid)
        self._ground = memory.parts.ground
        self._n_built = memory.parts.built.learned.n_neurons
        self._n_lessons = len(memory.journal.entries) if memory.journal is not None else 0
        self._spacing_rad = usual_spacing(memory.parts.built.learned)
        self._previous: Parts | None = None

    def take_in(self, lesson: Lesson, *, rehearsal: bool = False) -> Learned:
        """Learn a lesson; a rehearsal goes through all of it and keeps nothing.

        Raises:
            RequestError: the path cannot be learned; names place and value.
            ArtefactError: the journal cannot take it; nothing is learned then.
        """
        began_ns = monotonic_ns()
        path = self._checked(lesson)
        roadmap = self._parts.roadmap
        among_cells = None if lesson.cells is None else self._check_among(lesson.cells)
        addition = learn(roadmap, path, self._rules(lesson), self._check_among(None), among_cells)
        larger = grown(roadmap, addition, self._ground)
        if not rehearsal and not addition.is_empty:
            self._write_down(lesson, addition)
            self._previous = self._parts  # kept until the next lesson: to free a table takes milliseconds, and must not fall to the loop
            self._parts = self._parts.on(larger)
            self._n_lessons += 1
        reply = LearnReply(
            n_neurons=larger.n_neurons,
            n_edges=larger.n_edges,
            added_neurons=len(addition.neurons_rad),
            added_edges=len(addition.edges),
            seconds=(monotonic_ns() - began_ns) / 1e9,
            number=None if addition.is_empty else self._n_lessons,
        )
        if addition.is_empty:
            return Learned(lesson, reply, self._parts)
        return self._ready(lesson, reply, self._parts.on(larger))

    def _check_among(self, cells: I32 | None) -> MotionCheck:
        """Whether a straight motion is free among ``cells`` (C,); None: where nothing is seen."""
        grid, never = self._parts.grid, self._parts.roadmap.table.unavoidable
        seen = self._empty if cells is None else cells_of(grid, np.setdiff1d(cells, never).astype(np.int32))
        return lambda a, b: self._checker.segment(seen, a, b)

    def _write_down(self, lesson: Lesson, addition: Addition) -> None:
        if self._journal is None:
            return
        try:
            self._journal = self._journal.with_entry(utc_ns(), lesson.label, lesson.source, addition)
        except OSError as error:
            raise ArtefactError(f"{self._journal.path}: cannot be written: {error.strerror}", code="journal_not_written") from None

    def _ready(self, lesson: Lesson, reply: LearnReply, parts: Parts) -> Learned:
        """With all that the exchange needs, made here."""
        roadmap = parts.roadmap
        counts = roadmap.counts(parts.grid)
        counts.set_cells(self._reflex.vision.counts.cells)
        surcharges = self._reflex.planner.finder.surcharges.tolist()
        finder = PathFinder(roadmap, self._reflex.checker, surcharges)  # the loop's own checker: only the loop will use this finder
        return Learned(lesson, reply, parts, QuestionDesk(parts, monotonic_ns, self._sampler), finder, counts)

    def _checked(self, lesson: Lesson) -> F64:
        _refuse_lattice(self._parts.roadmap.model)
        most = self._parts.config.learning.max_samples
        if len(lesson.label) > MAX_LABEL:
            raise RequestError(f"label: {len(lesson.label)} characters, at most {MAX_LABEL}", code="too_long")
        if lesson.q_rad.ndim == 2 and len(lesson.q_rad) > most:
            raise RequestError(f"q_rad: {len(lesson.q_rad)} samples, at most {most} ([planner.learning] max_samples)", code="too_long")
        _check_times(lesson)
        if self._complaint:
            raise RequestError(f"nothing is learned while its journal cannot be used: {self._complaint}", code="bad_journal")
        return check_path(lesson.q_rad, self._parts.robot, self._checker, self._empty)

    def _rules(self, lesson: Lesson) -> LearningRules:
        config = self._parts.config.learning
        room = config.max_added_neurons - (self._parts.roadmap.n_neurons - self._n_built)
        if room <= 0:
            what = f"[planner.learning] max_added_neurons = {config.max_added_neurons}"
            raise RequestError(f"the map has grown as far as it may ({what}); tolman map revert makes room", code="map_full")
        return LearningRules(
            self._spacing_rad,
            config.reuse_share * self._spacing_rad,
            config.join_neighbours,
            config.join_max_rad,
            max_neurons=room,
            exactly=lesson.source != "taught",
        )


def _refuse_lattice(model: str) -> None:
    if model != "gng":
        raise RequestError(
            f"planner/learn: a {model} has a fixed grid, in which a further neuron has no place: it cannot be extended; train it anew "
            "on the motion (tolman build --motions), or run a gng",
            code="cannot_extend",
            facts={"model": model},
        )


def _check_times(lesson: Lesson) -> None:
    t_s = lesson.t_s
    if t_s is None:
        return
    if t_s.shape != lesson.q_rad.shape[:1]:
        raise RequestError(f"t_s: expected a time for each sample {list(lesson.q_rad.shape[:1])}, got {list(t_s.shape)}", code="bad_shape")
    later = np.diff(t_s) > 0.0  # false for what is not a number, too
    if not (np.isfinite(t_s).all() and later.all()):
        k = int(np.argmin(np.isfinite(t_s))) if not np.isfinite(t_s).all() else int(np.argmin(later)) + 1
        raise RequestError(f"t_s[{k}]: {t_s[k]} is not after the one before", code="bad_times", facts={"index": k})


class Learner:
    """The thread: lessons in, learned ones out.

    Args:
        student: learns.
        max_waiting: lessons that may wait.
        wake: called when something was learned.
    """

    def __init__(self, student: Student, max_waiting: int, wake: Callable[[], None]) -> None:
        self._student, self._wake = student, wake
        self._lessons: queue.Queue[Lesson | None] = queue.Queue(max_waiting)
        self._learned: queue.SimpleQueue[Learned] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="learner", daemon=True)
        self._thread.start()

    def offer(self, lesson: Lesson) -> bool:
        """Take a lesson if there is room."""
        try:
            self._lessons.put_nowait(lesson)
        except queue.Full:
            return False
        return True

    def take(self) -> Learned | None:
        """The next lesson that was learned, in order; None if there is none yet."""
        try:
            return self._learned.get_nowait()
        except queue.Empty:
            return None

    def close(self) -> None:
        """Learn no more; who waits gets no answer."""
        while True:
            with suppress(queue.Full):
                self._lessons.put_nowait(None)
                break
            with suppress(queue.Empty):
                self._lessons.get_nowait()
        self._thread.join(timeout=5.0)

    def _run(self) -> None:
        while (lesson := self._lessons.get()) is not None:
            try:
                self._learned.put(self._student.take_in(lesson))
                self._wake()
            except TolmanError as error:
                _refuse(lesson, error)
            except Exception:  # a lesson may never end the thread
                log.exception("a lesson failed")
                _refuse(lesson, RequestError("the planner could not learn this; see its log", code="internal"))


def _refuse(lesson: Lesson, error: TolmanError) -> None:
    log.info("not learned %s: %s: %s", lesson.label or lesson.source, error.code, error.message)
    if lesson.command is not None:
        lesson.command.fail(error)
