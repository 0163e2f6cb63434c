"""A kept gas learns a task's motions: it gets better there, stays what it was elsewhere, and is free of collisions."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from common.errors import ConfigError, TolmanError
from services.planner.config import PlannerConfig
from services.planner.core.cognitive_map import CognitiveMap, quantisation_error_rad, statistics
from services.planner.core.lookup import cells_of_pose
from services.planner.core.world import no_cells
from services.planner.kernels.collision import FREE
from services.planner.offline import build
from services.planner.offline.build import Job
from services.planner.offline.config import ExtendConfig
from services.planner.offline.extend import Extended, extend, samples_to_extend_by
from services.planner.offline.motions import resample
from services.planner.offline.scene import Scene
from tests.support.cell import ur3_cell


@pytest.fixture(scope="module")
def config(small: PlannerConfig) -> PlannerConfig:
    return msgspec.structs.replace(small, extend=ExtendConfig(n_added=40))


@pytest.fixture(scope="module")
def kept(config: PlannerConfig, tmp_path_factory: pytest.TempPathFactory) -> build.Built:
    return build.run(Job.of(ur3_cell(), config, cache=tmp_path_factory.mktemp("cache")))[0]


@pytest.fixture(scope="module")
def task_rad(scene: Scene) -> np.ndarray:
    """(S, 6) a sweep to the other side of the arm, where no motion of the small map leads."""
    return resample([line(scene, 1.0)], 300).q_rad


@pytest.fixture(scope="module")
def extended(scene: Scene, config: PlannerConfig, kept: build.Built, task_rad: np.ndarray) -> Extended:
    return extend(scene, config, kept.learned, task_rad)


def test_it_knows_the_task_and_still_knows_the_rest(extended: Extended, kept: build.Built, task_rad: np.ndarray) -> None:
    before, after = kept.learned, extended.learned
    assert after.n_neurons == before.n_neurons + 40 == extended.figures["neurons_before"] + 40
    assert quantisation_error_rad(after, task_rad) < 0.2 * quantisation_error_rad(before, task_rad)
    assert extended.figures["quantisation_error_before_rad"] == quantisation_error_rad(before, task_rad)
    assert quantisation_error_rad(after, before.q_rad) < 0.1, "what it knew has moved away"


def test_it_is_whole_and_free_and_has_its_table(scene: Scene, extended: Extended) -> None:
    checker, nothing, q = scene.checker(), no_cells(scene.grid), extended.learned.q_rad
    assert statistics(extended.learned, q).components == 1
    assert all(checker.pose(nothing, p)[0] == FREE for p in q)
    assert all(checker.segment(nothing, q[a], q[b]) for a, b in extended.learned.edges)
    last = len(q) - 1  # a neuron that the kept table could not know
    cells = np.setdiff1d(cells_of_pose(scene.arm, scene.grid, q[last], safety_m=scene.margins.safety_m), extended.table.unavoidable)
    assert len(cells) > 0 and all(last in extended.table.neurons_of(cell) for cell in cells)
    n_table = np.bincount(extended.table.node_owner, minlength=len(q))[last]
    assert n_table == len(cells)


def test_same_arguments_same_bytes(
    scene: Scene, config: PlannerConfig, kept: build.Built, task_rad: np.ndarray, extended: Extended
) -> None:
    told: list[tuple[str, float]] = []
    again = extend(scene, config, kept.learned, task_rad, lambda stage, share: told.append((stage, share)))
    assert again.learned.q_rad.tobytes() == extended.learned.q_rad.tobytes()
    assert again.learned.edges.tobytes() == extended.learned.edges.tobytes()
    assert again.table.node_owner.tobytes() == extended.table.node_owner.tobytes()
    assert list(dict.fromkeys(stage for stage, _ in told)) == ["map", "prune", "table"]
    other = msgspec.structs.replace(config, extend=ExtendConfig(n_added=40, seed=1))
    assert extend(scene, other, kept.learned, task_rad).learned.q_rad.tobytes() != extended.learned.q_rad.tobytes()


def test_without_room_to_grow_it_adapts(scene: Scene, config: PlannerConfig, kept: build.Built, task_rad: np.ndarray) -> None:
    full = msgspec.structs.replace(config, extend=ExtendConfig(n_added=0))
    adapted = extend(scene, full, kept.learned, task_rad)
    assert adapted.learned.n_neurons == kept.learned.n_neurons
    assert quantisation_error_rad(adapted.learned, task_rad) < quantisation_error_rad(kept.learned, task_rad)


def test_what_lies_apart_stays_where_it_is(scene: Scene, config: PlannerConfig, kept: build.Built, task_rad: np.ndarray) -> None:
    n, pocket = kept.learned.n_neurons, scene.robot.home_rad + np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 4.0], [0.0, 0.0, 0.0, 0.0, 0.0, 4.2]])
    apart = CognitiveMap.of(np.vstack([kept.learned.q_rad, pocket]), np.vstack([kept.learned.edges, [[n, n + 1]]]))
    extended = extend(scene, config, apart, task_rad)
    assert extended.learned.n_neurons == n + 2 + 40
    here = [int(np.flatnonzero((extended.learned.q_rad == q).all(axis=1))[0]) for q in pocket]
    assert here in extended.learned.edges.tolist()
    assert (extended.figures["components"], extended.figures["islands"]) == (1, 1)
    long_bridges = msgspec.structs.replace(config, map=msgspec.structs.replace(config.map, bridge_max_rad=6.0))
    joined = extend(scene, long_bridges, apart, task_rad)
    assert joined.figures["islands"] == 0 and joined.learned.n_neurons == n + 2 + 40


@pytest.mark.parametrize("model", ["som", "gamma_som"])
def test_a_lattice_is_refused(scene: Scene, config: PlannerConfig, kept: build.Built, task_rad: np.ndarray, model: str) -> None:
    with pytest.raises(ConfigError, match=f"a {model} has a fixed grid and cannot be extended; train it anew with --motions") as caught:
        extend(scene, msgspec.structs.replace(config, model=model), kept.learned, task_rad)
    assert caught.value.code == "cannot_extend"


@pytest.mark.parametrize("samples", [np.zeros((5, 4)), np.zeros((1, 6)), np.full((5, 6), np.nan)], ids=["four joints", "one", "nan"])
def test_useless_samples_are_refused(scene: Scene, config: PlannerConfig, kept: build.Built, samples: np.ndarray) -> None:
    with pytest.raises(TolmanError, match="samples") as caught:
        extend(scene, config, kept.learned, samples)
    assert caught.value.code == "bad_motions"


def test_a_map_that_would_grow_too_large_is_refused(scene: Scene, config: PlannerConfig, kept: build.Built, task_rad: np.ndarray) -> None:
    too_many = msgspec.structs.replace(config, extend=ExtendConfig(n_added=200_000))
    with pytest.raises(ConfigError, match="n_added: 150 \\+ 200000"):
        extend(scene, too_many, kept.learned, task_rad)


def line(scene: Scene, sweep_rad: float) -> np.ndarray:
    """(2, 6) a motion to the other side of the arm."""
    home = scene.robot.home_rad
    return home + np.array([[1.8, -0.2, 0.0, 0.0, 0.0, 0.0], [1.8 + sweep_rad, 0.2, -0.4, 0.3, 0.0, 1.0]])


def test_a_job_extends_the_kept_map_and_keeps_both(config: PlannerConfig, kept: build.Built, scene: Scene) -> None:
    cache, motion = kept.path.parent, line(scene, 1.0)
    stamp = kept.path.stat().st_mtime_ns
    job = Job.of(ur3_cell(), config, cache=cache, extension=[motion])
    assert job.base.path == kept.path != job.path
    built, seconds = build.run(job)
    assert kept.path.stat().st_mtime_ns == stamp, "the kept map was made anew"
    assert list(seconds) == ["extend", "total"]
    samples = samples_to_extend_by(config, [motion])
    assert len(samples.q_rad) >= 40 * 1500 / 150  # as many a neuron as the map has
    expected = extend(scene, config, kept.learned, samples.q_rad)
    assert built.learned.q_rad.tobytes() == expected.learned.q_rad.tobytes()
    assert built.table.node_owner.tobytes() == expected.table.node_owner.tobytes()
    again = build.load(job)
    assert again.sha256 == built.sha256 and again.figures == built.figures
    assert (built.figures["extended_by"], built.figures["base_sha256"], built.figures["neurons_before"]) == (1, kept.sha256, 150)


def test_the_config_names_the_same_extension_by_file_and_others_have_other_files(
    config: PlannerConfig, kept: build.Built, scene: Scene, tmp_path: Path
) -> None:
    cache, motion = kept.path.parent, line(scene, 1.0)
    np.save(tmp_path / "m.npy", motion)
    by_file = msgspec.structs.replace(config, extend=ExtendConfig(n_added=40, motions=[str(tmp_path / "m.npy")]))
    paths = [
        Job.of(ur3_cell(), config, cache=cache).path,
        Job.of(ur3_cell(), config, cache=cache, extension=[motion]).path,
        Job.of(ur3_cell(), config, cache=cache, extension=[motion, motion]).path,
        Job.of(ur3_cell(), config, [motion], cache=cache).path,
        Job.of(ur3_cell(), msgspec.structs.replace(config, extend=ExtendConfig(n_added=41)), cache=cache, extension=[motion]).path,
    ]
    assert len(set(paths)) == len(paths)
    assert Job.of(ur3_cell(), by_file, cache=cache).path == paths[1]
    assert Job.of(ur3_cell(), msgspec.structs.replace(config, extend=ExtendConfig()), cache=cache).path == paths[0]


@pytest.mark.parametrize("model", ["som", "gamma_som"])
def test_a_job_that_would_extend_a_lattice_is_refused_before_anything_is_made(config: PlannerConfig, model: str, tmp_path: Path) -> None:
    lattice = msgspec.structs.replace(config, model=model)
    with pytest.raises(ConfigError, match=f"a {model} has a fixed grid and cannot be extended") as caught:
        Job.of(ur3_cell(), lattice, cache=tmp_path, extension=[tmp_path / "is-not-even-read.npy"])
    assert caught.value.code == "cannot_extend"
    named = msgspec.structs.replace(lattice, extend=ExtendConfig(motions=["nothing.npy"]))
    with pytest.raises(ConfigError, match="cannot be extended"):
        Job.of(ur3_cell(), named, cache=tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_motions_without_length_are_refused_before_the_map_is_looked_for(config: PlannerConfig, tmp_path: Path) -> None:
    job = Job.of(ur3_cell(), config, cache=tmp_path, extension=[np.zeros((3, 6))])
    with pytest.raises(TolmanError, match="every path is a point") as caught:
        build.run(job)
    assert caught.value.code == "bad_motions" and list(tmp_path.iterdir()) == []
