"""Prepares the planner for what the gripper holds, in a thread of its own: an arm with a box, its table, all that plans with them.

The loop only exchanges references (:meth:`Ready.adopt`). Tables made last are kept, so that the same box again is ready at once.
"""

from __future__ import annotations

import logging
import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

from common.clock import monotonic_ns
from common.errors import RequestError, TolmanError
from common.robot.payload import Payload
from services.planner.assemble import Parts
from services.planner.core.goals import GoalResolver
from services.planner.core.lookup import BlockedCounts
from services.planner.core.motion import MotionPlanner
from services.planner.core.reflex import Reflex
from services.planner.questions import QuestionDesk

__all__ = ["Carrier", "Ready"]

log = logging.getLogger("planner")
KEPT = 4  # tables of boxes; our choice: some 60 MB each


@dataclass(frozen=True, eq=False)
class Ready:
    """What was prepared; ``problem`` instead if the box cannot be held.

    Attributes:
        payload: what is held, None for nothing.
        seconds: that it took.
    """

    payload: Payload | None
    seconds: float
    problem: str = ""
    parts: Parts | None = None
    planner: MotionPlanner | None = None
    resolver: GoalResolver | None = None
    desk: QuestionDesk | None = None
    counts: BlockedCounts | None = None

    def adopt(self, reflex: Reflex) -> None:
        """Exchange what the live planner plans with; in the loop's thread."""
        if self.planner is not None and self.counts is not None:
            reflex.rearm(self.planner, self.counts)


class Carrier:
    """The thread: the newest wish in, what was prepared out.

    Args:
        reflex: the live planner; of it only the live cells are taken.
        wake: called when something was prepared.
    """

    def __init__(self, reflex: Reflex, wake: Callable[[], None]) -> None:
        self._reflex, self._wake = reflex, wake
        self._kept: OrderedDict[Payload, Parts] = OrderedDict()
        self._kept_of: Parts | None = None
        self._changed = threading.Condition()
        self._wish: tuple[Parts, Payload | None] | None = None
        self._ready: Ready | None = None
        self._is_closed = False
        self._thread = threading.Thread(target=self._run, name="carrier", daemon=True)
        self._thread.start()

    def want(self, bare: Parts, payload: Payload | None) -> None:
        """Prepare for ``payload`` on ``bare``; an earlier wish that waits, and what is ready for it, is forgotten."""
        with self._changed:
            self._wish, self._ready = (bare, payload), None
            self._changed.notify()

    def take(self) -> Ready | None:
        """What was prepared for the newest wish; None until it is."""
        with self._changed:
            ready, self._ready = self._ready, None
            return ready

    def close(self) -> None:
        """Prepare no more."""
        with self._changed:
            self._is_closed = True
            self._changed.notify()
        self._thread.join(timeout=5.0)

    def _run(self) -> None:
        while True:
            with self._changed:
                while self._wish is None and not self._is_closed:
                    self._changed.wait()
                if self._is_closed or self._wish is None:
                    return
                wish, self._wish = self._wish, None
            ready = self._prepare(*wish)
            with self._changed:
                if self._wish is None:
                    self._ready = ready
            self._wake()

    def _prepare(self, bare: Parts, payload: Payload | None) -> Ready:
        began_ns = monotonic_ns()
        try:
            parts = bare if payload is None else self._holding(bare, payload)
            counts = BlockedCounts(parts.roadmap.table, parts.roadmap.n_neurons, parts.roadmap.n_edges)
            counts.set_cells(self._reflex.vision.counts.cells)
            made = (parts, parts.motion_planner(), parts.goal_resolver(), QuestionDesk(parts, monotonic_ns), counts)
            return Ready(payload, (monotonic_ns() - began_ns) / 1e9, "", *made)
        except TolmanError as error:
            problem = error
        except Exception:  # a box may never end the thread
            log.exception("no table for what is held")
            problem = RequestError("the planner could not make a table for it; see its log", code="internal")
        return Ready(payload, (monotonic_ns() - began_ns) / 1e9, problem.message)

    def _holding(self, bare: Parts, payload: Payload) -> Parts:
        if self._kept_of is not bare:
            self._kept_of = bare
            self._kept.clear()
        if payload not in self._kept:
            self._kept[payload] = bare.holding(payload)
        self._kept.move_to_end(payload)
        while len(self._kept) > KEPT:
            self._kept.popitem(last=False)
        return self._kept[payload]
