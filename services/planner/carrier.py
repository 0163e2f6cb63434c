"""Prepares the planner for what the gripper holds, in a thread of its own: an arm with a box, its table, all that plans with them.

The loop only exchanges references (:meth:`Ready.adopt`). What the last boxes add is kept, so that the same box again is ready at once;
where the map has learned meanwhile, only that is looked at.
"""

from __future__ import annotations

import logging
import threading
from collections import OrderedDict, deque
from collections.abc import Callable
from dataclasses import dataclass

from common.clock import monotonic_ns
from common.errors import RequestError, TolmanError
from common.robot.payload import Payload
from services.planner.assemble import Load, Parts
from services.planner.core.goals import GoalResolver
from services.planner.core.lookup import BlockedCounts
from services.planner.core.motion import MotionPlanner
from services.planner.core.reflex import Reflex
from services.planner.core.ways import Sampler
from services.planner.questions import QuestionDesk

__all__ = ["Carrier", "Ready"]

log = logging.getLogger("planner")
KEPT = 8  # boxes; our choice
END_WITHIN_S = 1.0  # a table that is half made is left; our choice


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
        sampler_of: makes what puts questions to the fallback, for an arm that holds a box; None: there is no fallback.
    """

    def __init__(self, reflex: Reflex, wake: Callable[[], None], sampler_of: Callable[[Payload | None], Sampler] | None = None) -> None:
        self._reflex, self._wake, self._sampler_of = reflex, wake, sampler_of
        self._kept: OrderedDict[Payload, Load] = OrderedDict()
        self._changed = threading.Condition()
        self._wish: tuple[Parts, Payload | None] | None = None
        self._ready: Ready | None = None
        self._is_closed = False
        # The last but one is kept until the next: to free a table takes milliseconds, and must not fall to the loop.
        self._made: deque[Ready] = deque(maxlen=2)
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
        self._thread.join(timeout=END_WITHIN_S)

    def _run(self) -> None:
        while True:
            with self._changed:
                while self._wish is None and not self._is_closed:
                    self._changed.wait()
                if self._is_closed or self._wish is None:
                    return
                wish, self._wish = self._wish, None
            ready = self._prepare(*wish)
            self._made.append(ready)
            with self._changed:
                if self._wish is None:
                    self._ready = ready
            self._wake()

    def _prepare(self, bare: Parts, payload: Payload | None) -> Ready:
        began_ns = monotonic_ns()
        try:
            parts = bare if payload is None else self._holding(bare, payload)
            counts = parts.roadmap.counts(parts.grid)
            counts.set_cells(self._reflex.vision.counts.cells)
            sampler = None if self._sampler_of is None else self._sampler_of(payload)
            made = (parts, parts.motion_planner(), parts.goal_resolver(), QuestionDesk(parts, monotonic_ns, sampler), counts)
            return Ready(payload, (monotonic_ns() - began_ns) / 1e9, "", *made)
        except TolmanError as error:
            problem = error
        except Exception:  # a box may never end the thread
            log.exception("no table for what is held")
            problem = RequestError("the planner could not make a table for it; see its log", code="internal")
        return Ready(payload, (monotonic_ns() - began_ns) / 1e9, problem.message)

    def _holding(self, bare: Parts, payload: Payload) -> Parts:
        kept = self._kept.get(payload)
        load = bare.load(payload) if kept is None else kept.on(bare.roadmap)
        self._kept[payload] = load
        self._kept.move_to_end(payload)
        while len(self._kept) > KEPT:
            self._kept.popitem(last=False)
        return bare.holding(load)
