"""Making all training motions: in several processes, kept in chunks as they come, so that an interrupted build goes on where it was."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from common.cell import CellConfig
from common.errors import ArtefactError, ConfigError
from common.robot.model import RobotModel
from common.robot.taught import read_taught
from services.planner.config import MarginsConfig
from services.planner.offline import artefact
from services.planner.offline.config import MotionsConfig
from services.planner.offline.motions import MotionMaker
from services.planner.offline.scene import Scene

__all__ = ["Maker", "MotionOrder", "Order", "make_motions", "read_recorded"]

F64 = NDArray[np.float64]

CHUNK = 30  # motions in a file; our choice: some seconds of work


class Maker(Protocol):
    """Makes the motion of any index."""

    def motion(self, index: int) -> F64:
        """The path (P, J) of a motion."""
        ...


class Order(Protocol):
    """What is to be made, in chunks that are kept one by one; picklable for worker processes."""

    @property
    def fingerprint(self) -> str:
        """Of all that a chunk depends on and its file's name does not say."""
        ...

    @property
    def n_workers(self) -> int:
        """Processes that make the motions; does not change the result."""
        ...

    @property
    def chunks(self) -> list[range]:
        """The indices of each chunk's motions."""
        ...

    def path(self, chunk: range) -> Path:
        """The file of a chunk."""
        ...

    def maker(self) -> Maker:
        """What makes the motions, with its own scratch."""
        ...


@dataclass(frozen=True)
class MotionOrder:
    """The reaching motions of a cell, by their number."""

    cell: CellConfig
    margins: MarginsConfig
    config: MotionsConfig
    directory: Path
    fingerprint: str

    @property
    def chunks(self) -> list[range]:
        """The indices of each chunk's motions."""
        n = self.config.n_trajectories
        return [range(first, min(first + CHUNK, n)) for first in range(0, n, CHUNK)]

    def path(self, chunk: range) -> Path:
        """The file of a chunk."""
        return self.directory / f"motions-{chunk.start:05d}-{chunk.stop:05d}.tolman"

    @property
    def n_workers(self) -> int:
        """Processes that make the motions."""
        return self.config.n_workers

    def maker(self) -> MotionMaker:
        """What makes them."""
        return MotionMaker(Scene.of(self.cell, self.margins), self.config)


def make_motions(order: Order, progress: Callable[[float], None], meanwhile: Callable[[], None] = lambda: None) -> list[F64]:
    """The paths (P, J) of all motions, by index; chunks that are there already are read, the others made and kept.

    ``meanwhile`` is called while a first process makes the first chunk; it compiles what the others then find in the cache.
    """
    kept = {chunk.start: _read_chunk(order, chunk) for chunk in order.chunks}
    missing = [chunk for chunk in order.chunks if kept[chunk.start] is None]
    n_done = len(order.chunks) - len(missing)
    for start, paths in _make(order, missing, meanwhile):
        kept[start] = paths
        n_done += 1
        progress(n_done / len(order.chunks))
    return [path for chunk in order.chunks for path in kept[chunk.start] or []]


def _make(order: Order, missing: list[range], meanwhile: Callable[[], None]) -> Iterator[tuple[int, list[F64]]]:
    """Chunks as they get done: here if one process is enough, else in worker processes that end with this generator."""
    n_workers = min(order.n_workers, len(missing))
    if n_workers == 0:
        return
    if n_workers == 1:
        maker = order.maker()
        for chunk in missing:
            yield chunk.start, _make_chunk(order, chunk, maker)
        return
    executor = ProcessPoolExecutor(n_workers, mp_context=multiprocessing.get_context("spawn"), initializer=_start_worker, initargs=(order,))
    try:
        first = executor.submit(_work, missing[0])
        meanwhile()
        yield missing[0].start, first.result()
        running: dict[Future[list[F64]], int] = {executor.submit(_work, chunk): chunk.start for chunk in missing[1:]}
        while running:
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                yield running.pop(future), future.result()
    finally:  # also on Ctrl-C: chunks under way, seconds of work, are finished and kept
        executor.shutdown(wait=True, cancel_futures=True)


_worker: tuple[Order, Maker] | None = None  # one per worker process, made by its initializer


def _start_worker(order: Order) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole process group; the parent does the talking
    global _worker  # noqa: PLW0603  the executor hands nothing else to its tasks
    _worker = (order, order.maker())


def _work(chunk: range) -> list[F64]:
    assert _worker is not None
    return _make_chunk(_worker[0], chunk, _worker[1])


def _make_chunk(order: Order, chunk: range, maker: Maker) -> list[F64]:
    paths = [maker.motion(index) for index in chunk]
    arrays = {"points": np.concatenate(paths), "lengths": np.array([len(path) for path in paths], dtype=np.int64)}
    artefact.write(order.path(chunk), artefact.Artefact(arrays, {"motions": order.fingerprint}))
    return paths


def _read_chunk(order: Order, chunk: range) -> list[F64] | None:
    try:
        arrays = artefact.read(order.path(chunk), {"motions": order.fingerprint}).arrays
    except ArtefactError:
        return None  # not made yet, of another config, or torn: made anew
    return [np.array(path) for path in np.split(arrays["points"], np.cumsum(arrays["lengths"])[:-1])]


def read_recorded(path: Path, robot: RobotModel) -> F64:
    """A recorded motion (K >= 2, J) in radians: a file of ``tolman teach`` (``.json``), ``.npy``, or text with one comma-separated joint
    vector a line.

    Raises:
        ConfigError: not readable, torn, of another arm, wrong width, not finite, beyond a limit; names file, place and value.
    """
    if path.suffix == ".json":
        try:
            return read_taught(path, robot).q_rad
        except ArtefactError as error:  # a command line or a config named it
            raise ConfigError(error.message, code=error.code, facts=error.facts) from None
    n_joints = robot.n_joints
    try:
        is_binary = path.suffix == ".npy"
        q = np.asarray(np.load(path, allow_pickle=False) if is_binary else np.loadtxt(path, delimiter=",", ndmin=2), dtype=np.float64)
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: the motion cannot be read: {error}", facts={"path": str(path)}) from None
    if q.ndim != 2 or q.shape[1] != n_joints or len(q) < 2 or not np.all(np.isfinite(q)):
        raise ConfigError(f"{path}: expected finite joint vectors (K >= 2, {n_joints}), got shape {q.shape}", facts={"path": str(path)})
    outside = np.any((q < robot.position_min_rad) | (q > robot.position_max_rad), axis=1)
    if outside.any():
        k = int(np.argmax(outside))
        raise ConfigError(f"{path}: row {k}: {robot.limit_violation(q[k])}", facts={"path": str(path), "row": k})
    return q
