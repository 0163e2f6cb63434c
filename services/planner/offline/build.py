"""From nothing to a map that can be planned in: motions -> the chosen model -> prune -> table -> practice -> one file in the cache.

A job with an extension takes the kept map of the same job without it (made first where it is missing) and extends that.
Same robot, cell, config and recorded motions give the same bytes; nothing here is bounded by time. Seconds are reported, never kept.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from common.cache import cache_dir
from common.cell import CellConfig
from common.errors import ArtefactError
from services.planner.config import PlannerConfig
from services.planner.core.cognitive_map import CognitiveMap, n_components, statistics
from services.planner.core.layer_table import NO_LAYERS, LayerTable
from services.planner.core.lookup import LookupTable
from services.planner.core.roadmap import Roadmap
from services.planner.offline import artefact
from services.planner.offline.ahead import compile_ahead
from services.planner.offline.config import MapConfig
from services.planner.offline.exercises import Exercises, exercises_among_boxes, exercises_of_problems
from services.planner.offline.extend import extend, refuse_lattice, samples_to_extend_by
from services.planner.offline.finishing import CheckedMap, layer_rules, prune_grown, table_of
from services.planner.offline.growth import grow, model_of, parameters_of
from services.planner.offline.motion_store import MotionOrder, make_motions, read_recorded
from services.planner.offline.motions import Samples, resample
from services.planner.offline.practice import before_practice, n_to_practise, practise
from services.planner.offline.problem_motions import ProblemMotionMaker, ProblemOrder, TrainingProblem
from services.planner.offline.scene import Scene

__all__ = ["STAGES", "Built", "Job", "load", "load_file", "load_or_build", "run"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
Progress = Callable[[str, float], None]  # stage, share done 0..1

STAGES = ("motions", "map", "prune", "table", "practice", "write")
RULES_VERSION = 5  # raise when the same config would give other motions
MAP_VERSION = 11  # raise when the same motions would give another map


def _silent(stage: str, share: float) -> None:
    del stage, share


@dataclass(frozen=True, eq=False)
class Built:
    """A map with its table, as made or as read; ``figures`` are plain data that depend on nothing but the inputs.

    ``lattice_unit`` (N,) int32: where each neuron of a SOM or gamma-SOM stands, row * columns + column; None for a gas.
    """

    path: Path
    sha256: str  # of the file
    learned: CognitiveMap
    table: LookupTable
    fingerprints: dict[str, str]
    figures: dict[str, Any]
    lattice_unit: I32 | None = None


@dataclass(frozen=True, eq=False)
class Job:
    """What is to be built: for which cell, with which config, from which recorded motions ((K, J) each) besides the made ones.

    With ``problems`` the made motions are those of :mod:`services.planner.offline.problem_motions` instead of the cell's reaching motions.
    ``extension``: motions by which the trained map is extended afterwards; none: it is not.
    """

    cell: CellConfig
    config: PlannerConfig
    scene: Scene
    recorded: tuple[F64, ...]
    cache: Path
    problems: tuple[TrainingProblem, ...] = ()
    extension: tuple[F64, ...] = ()

    @staticmethod
    def of(
        cell: CellConfig,
        config: PlannerConfig,
        recorded: Sequence[F64 | Path] = (),
        cache: Path | None = None,
        extension: Sequence[F64 | Path] = (),
    ) -> Job:
        """A job; ``cache`` defaults to the user's. Motions (or files of them) come after those that the config names.

        Raises:
            RobotError: the robot cannot be loaded.
            ConfigError: parameters of the model that do not go together; a file of a motion cannot be used; ``cannot_extend``: a model
                that cannot be extended.
        """
        model_of(config)  # refuses now what it would refuse after all motions are made
        if config.extend.motions or extension:
            refuse_lattice(config)
        scene = Scene.of(cell, config.margins)

        def read(named: Sequence[str], given: Sequence[F64 | Path]) -> tuple[F64, ...]:
            return tuple(read_recorded(q, scene.robot) if isinstance(q, Path) else q for q in (*map(Path, named), *given))

        return Job(
            cell, config, scene, read(config.taught, recorded), cache or cache_dir(), extension=read(config.extend.motions, extension)
        )

    @property
    def base(self) -> Job:
        """The job of the map that is extended."""
        return replace(self, extension=())

    @property
    def motions_fingerprint(self) -> str:
        """Of all that the made motions depend on, their problems aside."""
        if self.problems:
            p, margins = self.config.problems, self.config.margins  # planned among shapes: no cell, and no margin to cells, plays a part
            made = [p.motions_per_problem, p.random_share, p.turn_max_rad, p.shift_max_m, p.seed]
            return _digest(self.scene.robot.fingerprint, made, margins.static_m, margins.self_m)
        motions = msgspec.structs.replace(self.config.motions, n_workers=1)
        return _digest(self.scene.robot.fingerprint, self.scene.grid.fingerprint, self.cell.static, motions, self.config.margins)

    @property
    def fingerprints(self) -> dict[str, str]:
        """Of robot, grid, and config: static layer, motions, margins, layers, model and its parameters, recorded motions, extension."""
        layers = [self.config.clearance.layers_m, self.config.clearance.block_m]
        config = _digest(
            MAP_VERSION, self.motions_fingerprint, layers, parameters_of(self.config), self.config.model, _hashes(self.recorded)
        )
        if n_to_practise(self.config) > 0:
            config = _digest(config, self.config.practice)
        if self.problems:
            config = _digest(config, self.config.problems.n_samples, [p.digest for p in self.problems])
        if self.extension:
            config = _digest(config, msgspec.structs.replace(self.config.extend, motions=[]), _hashes(self.extension))
        return {"robot": self.scene.robot.fingerprint, "grid": self.scene.grid.fingerprint, "config": config}

    @property
    def scene_fingerprints(self) -> dict[str, str]:
        """Of robot and grid alone: what any map that is to be used here must be made for."""
        return {name: value for name, value in self.fingerprints.items() if name != "config"}

    def on(self, problems: Sequence[TrainingProblem]) -> Job:
        """The same with other problems."""
        return replace(self, problems=tuple(problems))

    @property
    def path(self) -> Path:
        """Where the artefact is kept."""
        return self.cache / f"map-{'-'.join(value[:8] for value in self.fingerprints.values())}.tolman"

    @property
    def motions_dir(self) -> Path:
        """Where the made motions are kept, chunk by chunk."""
        return self.cache / f"motions-{self.motions_fingerprint[:16]}"


def _digest(*parts: Any) -> str:
    return hashlib.sha256(msgspec.msgpack.encode([RULES_VERSION, *parts], order="deterministic")).hexdigest()[:16]


def _hashes(motions: Sequence[F64]) -> list[str]:
    return [hashlib.sha256(np.ascontiguousarray(q).tobytes()).hexdigest() for q in motions]


def load(job: Job) -> Built:
    """The artefact of a job from the cache.

    Raises:
        ArtefactError: not there, torn, of another version, or made for something else; says which.
    """
    return load_file(job, job.path, job.fingerprints)


def load_file(job: Job, path: Path, fingerprints: Mapping[str, str]) -> Built:
    """The artefact in a file, made for what ``fingerprints`` say, and with the layers that ``job`` asks for.

    Raises:
        ArtefactError: not there, torn, of another version, or made for something else; says which.
    """
    kept = artefact.read(path, fingerprints)
    try:
        learned = CognitiveMap(kept.arrays["neurons_rad"], kept.arrays["edges"])
        table = LookupTable.of_arrays(_named(kept, "table_"), job.scene.grid.n_cells, _kept_layers(job, kept))
    except (KeyError, ValueError) as error:
        raise ArtefactError(f"{path}: an array is missing or does not fit: {error}", code="torn_artefact") from None
    sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
    return Built(path, sha256, learned, table, dict(kept.fingerprints), dict(kept.figures), kept.arrays.get("lattice_unit"))


def _named(kept: artefact.Artefact, prefix: str) -> dict[str, NDArray[Any]]:
    return {name.removeprefix(prefix): array for name, array in kept.arrays.items() if name.startswith(prefix)}


def _kept_layers(job: Job, kept: artefact.Artefact) -> LayerTable:
    rules = layer_rules(job.scene.arm, job.scene.grid, job.config)
    if rules is None:
        return NO_LAYERS
    return rules.table_of_arrays(_named(kept, "layer_"))


def load_or_build(job: Job, progress: Progress = _silent) -> Built:
    """The artefact from the cache; made first where it is missing or cannot be used."""
    try:
        return load(job)
    except ArtefactError:
        return run(job, progress)[0]


def run(job: Job, progress: Progress = _silent, *, force: bool = False) -> tuple[Built, dict[str, float]]:
    """Build and keep the artefact; also the seconds of each stage.

    Args:
        job: what to build.
        progress: called with (one of STAGES, share done).
        force: also make the motions anew instead of using chunks that an earlier build kept, and the map that is to be extended.

    Raises:
        TolmanError: the regions of the config cannot be reached; nothing can be learned from the extension.
    """
    if job.extension:
        return _run_extension(job, progress, force=force)
    layer_rules(job.scene.arm, job.scene.grid, job.config)  # what the table cannot hold is said before anything is made
    seconds: dict[str, float] = {}
    with _stage("motions", progress, seconds):
        paths = _paths(job, progress, force=force)
        samples = resample(paths, job.config.motions.n_samples)
    config = before_practice(job.config)
    with _stage("map", progress, seconds):
        grown = grow(config, samples, lambda share: progress("map", share))
    with _stage("prune", progress, seconds):
        checked = prune_grown(job.scene, config, grown, samples.q_rad)
    with _stage("table", progress, seconds):
        table = table_of(job.scene, config, checked.learned, lambda share: progress("table", share))
    with _stage("practice", progress, seconds):
        checked, table, practised = _practise(job, checked, table, paths, samples, progress)
    with _stage("write", progress, seconds):
        figures = {**_figures(job, checked, samples, len(paths), table), **practised}
        sha256 = artefact.write(job.path, artefact.Artefact(_arrays(checked, table), job.fingerprints, figures))
    seconds["total"] = sum(seconds.values())
    return Built(job.path, sha256, checked.learned, table, job.fingerprints, figures, checked.lattice_unit), seconds


def _run_extension(job: Job, progress: Progress, *, force: bool) -> tuple[Built, dict[str, float]]:
    samples = samples_to_extend_by(job.config, job.extension)
    base = run(job.base, progress, force=True)[0] if force else load_or_build(job.base, progress)
    began_s = time.monotonic()
    extended = extend(job.scene, job.config, base.learned, samples.q_rad, progress)
    figures = {"extended_by": len(job.extension), "base_sha256": base.sha256, **extended.figures}
    arrays = _arrays(CheckedMap(extended.learned), extended.table)
    sha256 = artefact.write(job.path, artefact.Artefact(arrays, job.fingerprints, figures))
    seconds = {"extend": round(time.monotonic() - began_s, 3)}
    return Built(job.path, sha256, extended.learned, extended.table, job.fingerprints, figures), {**seconds, "total": seconds["extend"]}


@contextmanager
def _stage(name: str, progress: Progress, seconds: dict[str, float]) -> Iterator[None]:
    start_s = time.monotonic()
    progress(name, 0.0)
    yield
    progress(name, 1.0)
    seconds[name] = round(time.monotonic() - start_s, 3)


def _practise(
    job: Job, checked: CheckedMap, table: LookupTable, paths: list[F64], samples: Samples, progress: Progress
) -> tuple[CheckedMap, LookupTable, dict[str, int]]:
    """The map after practice, its table, and how much it practised; as it is where nothing is left to practice.

    The figure ``components`` is of the map as it was pruned; what practice added apart from it is told as ``islands``.
    """
    if n_to_practise(job.config) == 0:
        return checked, table, {}

    def new_exercises() -> Exercises:
        maker, seed = _order(job).maker(), job.config.practice.seed
        return exercises_of_problems(maker, seed) if isinstance(maker, ProblemMotionMaker) else exercises_among_boxes(maker, paths, seed)

    roadmap = Roadmap.of(checked.learned, table, job.config.model)
    done = practise(job.scene, job.config, roadmap, new_exercises, samples.q_rad, lambda share: progress("practice", share))
    counted = {
        "components": n_components(checked.learned),
        "exercises": done.n_exercises,
        "unanswered": done.n_unanswered,
        "lessons": done.n_lessons,
        "lesson_neurons": done.n_neurons,
        "islands": done.n_islands,
    }
    return CheckedMap(done.learned), done.table, counted


def _paths(job: Job, progress: Progress, *, force: bool) -> list[F64]:
    order = _order(job)
    if force:
        for chunk in order.chunks:
            order.path(chunk).unlink(missing_ok=True)
    made = make_motions(order, lambda share: progress("motions", share), lambda: compile_ahead(job.scene, job.config))
    return [path for path in made if len(path)] + list(job.recorded)


def _order(job: Job) -> MotionOrder | ProblemOrder:
    place = job.motions_dir, job.motions_fingerprint
    if job.problems:
        return ProblemOrder(job.cell, job.config.margins, job.config.problems, job.problems, *place)
    return MotionOrder(job.cell, job.config.margins, job.config.motions, *place)


def _figures(job: Job, checked: CheckedMap, samples: Samples, n_trajectories: int, table: LookupTable) -> dict[str, Any]:
    """A lattice also names its model and size; a file that does not is of a gas. A map of problems names them."""
    lattice: dict[str, Any] = {}
    parameters = parameters_of(job.config)
    if not isinstance(parameters, MapConfig):
        n_dropped = parameters.rows * parameters.columns - checked.learned.n_neurons
        lattice = {"model": job.config.model, "rows": parameters.rows, "columns": parameters.columns, "dropped_units": n_dropped}
    figures = asdict(statistics(checked.learned, samples.q_rad))
    if job.problems:
        figures["problems"] = sorted(p.digest for p in job.problems)
    return {
        **lattice,
        "trajectories": n_trajectories,
        "samples": len(samples.q_rad),
        **figures,
        "table_bytes": table.n_bytes,
        "layer_bytes": table.layers.n_bytes,
    }


def _arrays(checked: CheckedMap, table: LookupTable) -> dict[str, NDArray[Any]]:
    lattice = {} if checked.lattice_unit is None else {"lattice_unit": checked.lattice_unit}
    rows = {f"table_{name}": array for name, array in table.arrays().items()}
    if table.layers.n_bands:
        rows |= {f"layer_{name}": array for name, array in table.layers.arrays().items()}
    return {"neurons_rad": checked.learned.q_rad, "edges": checked.learned.edges, **lattice, **rows}
