"""The referee for many paths: coal at 1/256 rad, in worker processes, each path looked at once however many rows it stands in."""

from __future__ import annotations

import hashlib
import multiprocessing
import signal
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.paper.study import Study
from benchmarks.referee import Referee
from common.cell import CellConfig
from common.geometry.grid import Grid
from common.robot.model import load_robot

__all__ = ["Case", "collisions"]

F64 = NDArray[np.float64]
N_WORKERS = 2  # issue: two cores
FEW = 3  # paths that are judged here: starting workers takes longer


@dataclass(frozen=True, eq=False)
class Case:
    """A path (P, J) among boxes (n, 2, 3: lowest and highest corners in metres)."""

    path_rad: F64
    boxes_m: F64

    @property
    def key(self) -> bytes:
        """Equal for equal paths among equal boxes."""
        digest = hashlib.sha256(np.ascontiguousarray(self.path_rad).tobytes())
        digest.update(np.ascontiguousarray(self.boxes_m).tobytes())
        return digest.digest()


def collisions(study: Study, cases: Sequence[Case]) -> list[bool]:
    """Whether each path truly collides: with a box's true shape, the static layer or the arm itself."""
    known: dict[bytes, bool] = study.once("judged", dict)
    keys = [case.key for case in cases]
    new = {key: case for key, case in zip(keys, cases, strict=True) if key not in known}
    if len(new) <= FEW:
        judge = _Judge(study.cell)
        known.update({key: judge.collides(case) for key, case in new.items()})
        return [known[key] for key in keys]
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(N_WORKERS, mp_context=context, initializer=_start_worker, initargs=(study.cell,)) as pool:
        verdicts = pool.map(_work, new.values(), chunksize=2)
        known.update(zip(new, study.shown(verdicts, "referee", len(new)), strict=True))
    return [known[key] for key in keys]


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
