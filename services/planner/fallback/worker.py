"""The fallback's own process (``python -m services.planner.fallback.worker``): RRTConnect in the whole joint space, question by question.

Beside it searches a second one that knows the map, as repair does, where the question brings one along.

It lives as long as the pipe from the planner: when that closes, however the planner ended, it is gone at once. Questions take turns,
slice by slice, so that a long one holds up nobody. Its searches may take several cores, and yield them to whoever drives the arm.
"""

from __future__ import annotations

import os
import queue
import signal
import sys
import threading
import time
from collections import OrderedDict
from concurrent.futures import ThreadPoolExecutor
from typing import IO, Any

import numpy as np

from common.robot.payload import Payload
from services.planner.config import MOST_SEARCHES
from services.planner.core.check import Checker
from services.planner.core.map_search import MapSearch
from services.planner.core.or_parallel import OrParallel
from services.planner.core.repair import tightened
from services.planner.core.two_trees import Bounds, Joined, TwoTrees, no_map, seed_of
from services.planner.core.world import cells_of, no_cells
from services.planner.fallback.carried_map import unpack
from services.planner.fallback.frames import Alive, Answer, Asked, Held, Ready, Setting, Withdrawn, read_frame, write_frame
from services.planner.kernels.cells import Cells
from services.planner.offline.scene import Scene

__all__ = ["Turns", "main"]

REHEARSAL_ITERATIONS = 60
ALIVE_S = 1.0  # between two words from a process that is at work; our choice
KEPT = 4  # arms with boxes; our choice
SLICE_ITERATIONS = 100  # three milliseconds or four, against a tenth of one to hand slices to threads; our choice
NICE = 5  # a third of the share of a process that wants the same core (sched(7)); our choice


class Turns:
    """The questions under way; each turn gives the oldest one slice and puts it behind the others."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._checkers: OrderedDict[Held | None, Checker] = OrderedDict()
        self._searches: dict[int, tuple[OrParallel[TwoTrees | MapSearch], Checker, Cells, float]] = {}
        self._pool = ThreadPoolExecutor(MOST_SEARCHES)

    def __len__(self) -> int:
        return len(self._searches)

    def take(self, frame: Asked | Withdrawn) -> None:
        """A new question, or one that is not asked any more."""
        if isinstance(frame, Withdrawn):
            self._searches.pop(frame.id, None)
            return
        cells = cells_of(self._scene.grid, np.frombuffer(frame.cells, dtype="<i4").astype(np.int32))
        checker = self._checker(frame.held)
        self._searches[frame.id] = (OrParallel(self._side_by_side(frame, checker, cells), self._pool), checker, cells, 0.0)

    def _side_by_side(self, frame: Asked, checker: Checker, cells: Cells) -> list[TwoTrees | MapSearch]:
        """RRTConnect in the bare joint space and, in turn with it, searches that know the map.

        Which of them is quicker differs from question to question. Measured, samples at the median of 10 generators, bare and with the map:
        38 000 and 26 000, 10 000 and 16 000, 9 500 and 4 000, 24 000 and 1 900, 10 000 and 8 700.
        """
        robot = self._scene.robot
        ends = (np.array(frame.q_start_rad), np.array(frame.q_goals_rad))
        joint_range = (robot.position_min_rad, robot.position_max_rad)
        seed, bounds = np.array(frame.seed, dtype=np.uint64), Bounds(frame.max_iterations, slice_iterations=SLICE_ITERATIONS)
        nothing = no_map(robot.n_joints)
        known = None if frame.known is None else unpack(frame.known, robot.n_joints)
        searches: list[TwoTrees | MapSearch] = []
        for k in range(frame.n_searches):
            rng = seed if k == 0 else seed_of(seed, np.array([k]))
            if known is None or k % 2 == 0:
                searches.append(TwoTrees(checker, cells, nothing, *ends, joint_range, rng, bounds))
            else:
                searches.append(MapSearch(checker, cells, known, *ends, joint_range, rng, bounds))
        return searches

    def _checker(self, held: Held | None) -> Checker:
        """For an arm that holds a box, or nothing; the last ones are kept."""
        if held not in self._checkers:
            scene = self._scene
            if held is not None:
                scene = scene.holding(Payload(held.size_m, held.position_m, held.quaternion_xyzw))
            self._checkers[held] = scene.checker()
        self._checkers.move_to_end(held)
        while len(self._checkers) > KEPT:
            self._checkers.popitem(last=False)
        return self._checkers[held]

    def turn(self) -> Answer | None:
        """One slice; the answer if that was the last one."""
        number = next(iter(self._searches))
        search, checker, cells, spent_ms = self._searches.pop(number)
        began = time.perf_counter()
        over = search.advance()
        found = search.found() if over else None
        if found is not None:
            found = tightened(checker, cells, found)
        spent_ms += (time.perf_counter() - began) * 1e3
        if not over:
            self._searches[number] = (search, checker, cells, spent_ms)
            return None
        return Answer(number, None if found is None else found.q_rad.tolist(), search.iterations, spent_ms)

    def rehearse(self) -> None:
        """Compile every kernel: a search from home that finds nothing in a few samples."""
        robot, checker = self._scene.robot, self._checker(None)
        ends = (robot.home_rad, robot.home_rad[None] + 0.01)
        joint_range = (robot.position_min_rad, robot.position_max_rad)
        empty, nothing = no_cells(self._scene.grid), no_map(robot.n_joints)
        search = TwoTrees(checker, empty, nothing, *ends, joint_range, np.arange(1, 5, dtype=np.uint64), Bounds(REHEARSAL_ITERATIONS))
        while not search.advance():
            pass
        tightened(checker, empty, Joined(np.array([ends[0], ends[0] + 0.01, ends[0]]), np.full(1, -1, dtype=np.int32)))


def _listen(pipe: IO[bytes], inbox: queue.SimpleQueue[Any]) -> None:
    while (frame := read_frame(pipe)) is not None:
        inbox.put(frame)
    os._exit(0)  # the planner is gone: whatever is being searched for is for nobody


def main() -> None:
    """Answer until the pipe closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole process group; the planner ends us
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # nothing that prints may get among the frames
    inbox: queue.SimpleQueue[Any] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(sys.stdin.buffer, inbox), name="listen", daemon=True).start()
    setting = inbox.get()
    assert isinstance(setting, Setting)
    os.nice(NICE)
    turns = Turns(Scene.of(setting.cell, setting.margins))
    turns.rehearse()
    write_frame(answers, Ready())
    told_s = time.monotonic()
    while True:
        while len(turns) == 0 or not inbox.empty():
            turns.take(inbox.get())
        answer = turns.turn()
        if answer is not None:
            write_frame(answers, answer)
        if time.monotonic() - told_s >= ALIVE_S:
            write_frame(answers, Alive())
            told_s = time.monotonic()


if __name__ == "__main__":
    main()
