"""Trained maps of the experiments: made once, kept in the user's cache, the same bytes for the same inputs."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from common.errors import ArtefactError
from services.planner.core.cognitive_map import CognitiveMap
from services.planner.core.lookup import LookupTable, build_table
from services.planner.core.roadmap import Roadmap
from services.planner.core.world import no_cells
from services.planner.kernels.collision import FREE
from services.planner.offline import artefact
from services.planner.offline.build import Job
from services.planner.offline.motion_store import MotionOrder, make_motions
from services.planner.offline.motions import Samples, resample
from services.planner.offline.pruning import without_collisions

__all__ = ["KeptMap", "Progress", "kept_map", "samples_of"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
Progress = Callable[[str, float], None]
VERSION = 1  # raise when the same inputs would give another map


@dataclass(frozen=True, eq=False)
class KeptMap:
    """A map with its table.

    Attributes:
        learned: neurons and edges that are free of the static layer and of the arm itself.
        table: which cells block what.
        unit: (N,) int32 which unit of the model each neuron was; a lattice's unit r * columns + c stands at row r, column c.
        seconds: of training and of the table, when they were made.
    """

    learned: CognitiveMap
    table: LookupTable
    unit: I32
    seconds: dict[str, float]

    def roadmap(self, model: str) -> Roadmap:
        """The map as a graph for the search."""
        return Roadmap.of(self.learned, self.table, model)


def samples_of(job: Job, progress: Progress) -> Samples:
    """The training samples of a job; its motions are made where the cache has none."""
    order = MotionOrder(job.cell, job.config.margins, job.config.motions, job.motions_dir, job.motions_fingerprint)
    return resample(make_motions(order, lambda share: progress("motions", share)), job.config.motions.n_samples)


def kept_map(job: Job, name: str, inputs: Any, learn: Callable[[], CognitiveMap], progress: Progress) -> KeptMap:
    """The map called ``name``, from the cache or made now: learned, rid of what collides, and its table built.

    Args:
        job: robot, grid, static layer, margins and cache.
        inputs: plain data that the result of ``learn`` depends on besides the job's robot, grid and motions.
        learn: neurons and edges; they may still collide.
        progress: called with (stage, share).
    """
    digest = hashlib.sha256(msgspec.msgpack.encode([VERSION, name, inputs, job.motions_fingerprint], order="deterministic")).hexdigest()[
        :16
    ]
    path = job.cache / f"paper-{name}-{digest}.tolman"
    try:
        return _of(artefact.read(path, {"inputs": digest}))
    except ArtefactError:
        pass
    began_s = time.monotonic()
    progress(name, 0.0)
    whole = learn()
    trained_s = time.monotonic()
    learned, unit = _free(job, whole)
    margins = job.config.margins
    table = build_table(
        job.scene.arm,
        job.scene.grid,
        learned.q_rad,
        learned.edges,
        safety_m=margins.safety_m,
        step_m=margins.step_m,
        progress=lambda done, total: progress("table", done / total),
    )
    seconds = {"training": round(trained_s - began_s, 3), "table": round(time.monotonic() - trained_s, 3)}
    rows = {f"table_{key}": getattr(table, key) for key in ("node_offset", "node_owner", "edge_offset", "edge_owner", "unavoidable")}
    arrays = {"neurons_rad": learned.q_rad, "edges": learned.edges, "unit": unit, **rows}
    artefact.write(path, artefact.Artefact(arrays, {"inputs": digest}, {"seconds": seconds}))
    return KeptMap(learned, table, unit, seconds)


def _free(job: Job, whole: CognitiveMap) -> tuple[CognitiveMap, I32]:
    """What of a map is free of the static layer and of the arm itself, and which of its units that are."""
    checker, nothing = job.scene.checker(), no_cells(job.scene.grid)
    free = np.array([checker.pose(nothing, q)[0] == FREE for q in whole.q_rad], dtype=np.bool_)
    kept = without_collisions(whole, lambda q: checker.pose(nothing, q)[0] == FREE, lambda a, b: checker.segment(nothing, a, b))
    return kept, np.flatnonzero(free).astype(np.int32)


def _of(kept: artefact.Artefact) -> KeptMap:
    arrays = kept.arrays
    table = LookupTable(**{key.removeprefix("table_"): array for key, array in arrays.items() if key.startswith("table_")})
    learned = CognitiveMap(arrays["neurons_rad"], arrays["edges"])
    return KeptMap(learned, table, arrays["unit"], dict(kept.figures["seconds"]))
