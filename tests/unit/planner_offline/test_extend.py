"""A kept gas learns a task's motions: it gets better there, stays what it was elsewhere, and is free of collisions."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from common.errors import ArtefactError, ConfigError, TolmanError
from services.planner.config import PlannerConfig
from services.planner.core.cognitive_map import quantisation_error_rad, statistics
from services.planner.core.lookup import cells_of_pose
from services.planner.core.world import no_cells
from services.planner.kernels.collision import FREE
from services.planner.offline import artefact, build
from services.planner.offline.build import Job
from services.planner.offline.config import ExtendConfig, GammaSomConfig, SomConfig
from services.planner.offline.extend import Extended, extend, kept_map
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
    home = scene.robot.home_rad
    ends = home + np.array([[1.8, -0.2, 0.0, 0.0, 0.0, 0.0], [2.8, 0.2, -0.4, 0.3, 0.0, 1.0]])
    return resample([ends], 300).q_rad


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


@pytest.mark.parametrize("model", ["som", "gamma_som"])
def test_a_lattice_is_refused(scene: Scene, config: PlannerConfig, kept: build.Built, task_rad: np.ndarray, model: str) -> None:
    with pytest.raises(ConfigError, match=f"a {model} has a fixed grid and cannot be extended; train it anew on all motions") as caught:
        extend(scene, msgspec.structs.replace(config, model=model), kept.learned, task_rad)
    assert caught.value.code == "cannot_extend"


@pytest.mark.parametrize("samples", [np.zeros((5, 4)), np.zeros((1, 6)), np.full((5, 6), np.nan)], ids=["four joints", "one", "nan"])
def test_useless_samples_are_refused(scene: Scene, config: PlannerConfig, kept: build.Built, samples: np.ndarray) -> None:
    with pytest.raises(TolmanError, match="samples") as caught:
        extend(scene, config, kept.learned, samples)
    assert caught.value.code == "bad_motions"


def test_a_map_that_would_grow_too_large_is_refused(scene: Scene, config: PlannerConfig, kept: build.Built, task_rad: np.ndarray) -> None:
    too_many = msgspec.structs.replace(config, extend=ExtendConfig(n_added=60_000))
    with pytest.raises(ConfigError, match="n_added: 150 \\+ 60000"):
        extend(scene, too_many, kept.learned, task_rad)


def test_the_kept_map_is_read_and_a_lattice_is_not(scene: Scene, small: PlannerConfig, kept: build.Built, tmp_path: Path) -> None:
    read = kept_map(kept.path, scene)
    assert read.q_rad.tobytes() == kept.learned.q_rad.tobytes() and read.edges.tobytes() == kept.learned.edges.tobytes()
    lattices = {
        "som": {"som": SomConfig(rows=8, columns=8)},
        "gamma_som": {"gamma_som": GammaSomConfig(rows=8, columns=8, epochs=2)},
    }
    few = msgspec.structs.replace(small, motions=msgspec.structs.replace(small.motions, n_trajectories=6, n_samples=300))
    for model, section in lattices.items():
        built = build.run(Job.of(ur3_cell(), msgspec.structs.replace(few, model=model, **section), cache=tmp_path))[0]
        with pytest.raises(ConfigError, match=f"{built.path.name}: a {model} has a fixed grid and cannot be extended"):
            kept_map(built.path, scene)


def test_what_is_no_map_of_this_robot_is_refused(scene: Scene, kept: build.Built, tmp_path: Path) -> None:
    with pytest.raises(ArtefactError, match="cannot be read"):
        kept_map(tmp_path / "nothing.tolman", scene)
    prints = {**kept.fingerprints, "robot": "another"}
    artefact.write(tmp_path / "foreign.tolman", artefact.Artefact({}, prints))
    with pytest.raises(ArtefactError, match="another robot"):
        kept_map(tmp_path / "foreign.tolman", scene)
    artefact.write(tmp_path / "empty.tolman", artefact.Artefact({}, kept.fingerprints))
    with pytest.raises(ArtefactError, match="neurons_rad"):
        kept_map(tmp_path / "empty.tolman", scene)
