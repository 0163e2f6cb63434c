"""Trained maps of the experiments: made once, kept in the user's cache, the same bytes for the same inputs."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import msgspec

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

Progress = Callable[[str, float], None]
VERSION = 1  # raise when the same inputs would give another map


@dataclass(frozen=True, eq=False)
class KeptMap:
    """A map with its table.

    Attributes:
        learned: neurons and edges that are free of the static layer and of the arm itself.
        table: which cells block what.
    """

    learned: CognitiveMap
    table: LookupTable

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
        return _of(job, artefact.read(path, {"inputs": digest}))
    except ArtefactError:
        pass
    progress(name, 0.0)
    learned = _free(job, learn())
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
    arrays: dict[str, Any] = {"neurons_rad": learned.q_rad, "edges": learned.edges}
    arrays |= {f"table_{key}": array for key, array in table.arrays().items()}
    artefact.write(path, artefact.Artefact(arrays, {"inputs": digest}))
    return KeptMap(learned, table)


def _free(job: Job, whole: CognitiveMap) -> CognitiveMap:
    """What of a map is free of the static layer and of the arm itself."""
    checker, nothing = job.scene.checker(), no_cells(job.scene.grid)
    return without_collisions(whole, lambda q: checker.pose(nothing, q)[0] == FREE, lambda a, b: checker.segment(nothing, a, b))


def _of(job: Job, kept: artefact.Artefact) -> KeptMap:
    arrays = kept.arrays
    rows: dict[str, Any] = {key.removeprefix("table_"): array for key, array in arrays.items() if key.startswith("table_")}
    table = LookupTable.of_arrays(rows, job.scene.grid.n_cells)
    learned = CognitiveMap(arrays["neurons_rad"], arrays["edges"])
    return KeptMap(learned, table)
