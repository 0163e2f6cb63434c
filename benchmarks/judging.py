"""The referee for many paths: coal at 1/256 rad, in worker processes."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.referee import Referee
from common.cell import CellConfig
from common.geometry.grid import Grid
from common.robot.model import load_robot

__all__ = ["Case", "Shown", "collisions"]

F64 = NDArray[np.float64]
Shown = Callable[[Iterable[bool], int], Iterator[bool]]  # passes verdicts on as they come, of so many, and tells of it
N_WORKERS = 2  # issue: two cores
FEW = 3  # paths that are judged here: starting workers takes longer


@dataclass(frozen=True, eq=False)
class Case:
    """A path (P, J) among boxes (n, 2, 3: lowest and highest corners in metres)."""

    path_rad: F64
    boxes_m: F64


def _quietly(verdicts: Iterable[bool], n: int) -> Iterator[bool]:
    del n
    return iter(verdicts)


def collisions(cell: CellConfig, cases: Sequence[Case], shown: Shown = _quietly) -> list[bool]:
    """Whether each path truly collides: with a box's true shape, the static layer or the arm itself."""
    if len(cases) <= FEW:
        judge = _Judge(cell)
        return [judge.collides(case) for case in cases]
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(N_WORKERS, mp_context=context, initializer=_start_worker, initargs=(cell,)) as pool:
        return list(shown(pool.map(_work, cases, chunksize=2), len(cases)))


class _Judge:
    def __init__(self, cell: CellConfig) -> None:
        self._referee = Referee(load_robot(cell.robot), cell.static)
        self._grid = Grid.of(cell.grid)

    def collides(self, case: Case) -> bool:
        return self._referee.path_collides(case.path_rad, self._grid, np.empty(0, dtype=np.int32), case.boxes_m)


_judge: _Judge | None = None  # one per worker process, made by its initializer


def _start_worker(cell: CellConfig) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole process group; the parent does the talking
    global _judge  # noqa: PLW0603  the executor hands nothing else to its tasks
    _judge = _Judge(cell)


def _work(case: Case) -> bool:
    assert _judge is not None
    return _judge.collides(case)
