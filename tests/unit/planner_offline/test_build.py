from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from common.errors import ArtefactError, ConfigError
from common.robot.taught import TaughtMotion, write_taught
from services.planner.config import ClearanceConfig, PlannerConfig
from services.planner.core.lattice import lattice_edges
from services.planner.core.world import no_cells
from services.planner.kernels.collision import FREE
from services.planner.offline import build, motion_store
from services.planner.offline.build import Job
from services.planner.offline.config import GammaSomConfig, SomConfig
from tests.support.cell import ur3, ur3_cell


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(scope="module")
def job(small: PlannerConfig, cache: Path) -> Job:
    return Job.of(ur3_cell(), small, cache=cache)


@pytest.fixture(scope="module")
def built(job: Job) -> build.Built:
    return build.run(job)[0]


def test_a_small_map_is_whole_free_and_told_in_figures(job: Job, built: build.Built) -> None:
    figures = built.figures
    assert (figures["neurons"], figures["components"], figures["trajectories"]) == (150, 1, 34)
    assert figures["samples"] >= 1500 and figures["edges"] == len(built.learned.edges) and figures["table_bytes"] == built.table.n_bytes
    checker, nothing = job.scene.checker(), no_cells(job.scene.grid)
    q = built.learned.q_rad
    assert all(checker.pose(nothing, p)[0] == FREE for p in q)
    assert all(checker.segment(nothing, q[a], q[b]) for a, b in built.learned.edges)


LATTICES: dict[str, dict[str, Any]] = {
    "som": {"som": SomConfig(rows=12, columns=11)},
    "gamma_som": {"gamma_som": GammaSomConfig(rows=12, columns=11, epochs=3)},
}


@pytest.mark.parametrize("model", LATTICES)
def test_a_lattice_is_built_to_a_free_part_of_itself(model: str, small: PlannerConfig, job: Job, built: build.Built, cache: Path) -> None:
    del built  # its motions serve all models
    config = msgspec.structs.replace(small, model=model, **LATTICES[model])
    lattice = Job.of(ur3_cell(), config, cache=cache)
    made, _ = build.run(lattice)
    figures, unit = made.figures, made.lattice_unit
    assert unit is not None and np.all(np.diff(unit) > 0) and 0 <= unit[0] <= unit[-1] < 132
    assert (figures["model"], figures["rows"], figures["columns"], figures["components"]) == (model, 12, 11, 1)
    assert figures["neurons"] == len(unit) == 132 - figures["dropped_units"] > 100
    edges = {tuple(sorted(pair)) for pair in unit[made.learned.edges].tolist()}
    assert edges <= {tuple(sorted(pair)) for pair in lattice_edges(12, 11, 8).tolist()}
    checker, nothing = job.scene.checker(), no_cells(job.scene.grid)
    q = made.learned.q_rad
    assert all(checker.pose(nothing, p)[0] == FREE for p in q)
    assert all(checker.segment(nothing, q[a], q[b]) for a, b in made.learned.edges)
    kept = build.load(lattice)
    assert kept.sha256 == made.sha256 == build.run(lattice)[0].sha256
    assert kept.lattice_unit is not None and kept.lattice_unit.tobytes() == unit.tobytes()


def test_a_gas_has_no_lattice(job: Job, built: build.Built) -> None:
    assert built.lattice_unit is None and build.load(job).lattice_unit is None
    assert not {"model", "rows"} & set(built.figures)


def test_progress_passes_through_all_stages(small: PlannerConfig, job: Job, built: build.Built, tmp_path: Path) -> None:
    del built
    told: list[tuple[str, float]] = []
    _, seconds = build.run(job, lambda stage, share: told.append((stage, share)))
    assert list(dict.fromkeys(stage for stage, _ in told)) == list(build.STAGES)
    for stage in build.STAGES:
        shares = [share for name, share in told if name == stage]
        assert shares[0] == 0.0 and shares[-1] == 1.0 and shares == sorted(shares)
    assert set(seconds) == {*build.STAGES, "total"}


def test_what_is_kept_is_what_was_built(job: Job, built: build.Built) -> None:
    kept = build.load(job)
    assert kept.sha256 == built.sha256 and kept.figures == built.figures
    np.testing.assert_array_equal(kept.learned.q_rad, built.learned.q_rad)
    np.testing.assert_array_equal(kept.learned.edges, built.learned.edges)
    for name in ("node_offset", "node_owner", "edge_offset", "edge_owner", "unavoidable"):
        np.testing.assert_array_equal(getattr(kept.table, name), getattr(built.table, name))
        assert getattr(kept.table, name).dtype == getattr(built.table, name).dtype
    layers, as_built = kept.table.layers, built.table.layers
    assert layers.n_bands == 3 and layers.block_cells == 2 and layers.n_bytes == kept.figures["layer_bytes"] > 0
    np.testing.assert_array_equal(layers.beyond_m, as_built.beyond_m)
    for name in ("node_offset", "node_owner", "edge_offset", "edge_owner"):
        np.testing.assert_array_equal(getattr(layers, name), getattr(as_built, name))
        assert getattr(layers, name).dtype == getattr(as_built, name).dtype


def test_a_map_can_be_built_without_layers(small: PlannerConfig, built: build.Built, cache: Path) -> None:
    del built  # its motions serve this one too
    config = msgspec.structs.replace(small, clearance=ClearanceConfig(layers_m=[]))
    plain = Job.of(ur3_cell(), config, cache=cache)
    assert build.run(plain)[0].table.layers.n_bands == build.load(plain).table.layers.n_bands == 0


def test_built_anew_by_two_processes_it_is_the_same_bytes(
    small: PlannerConfig, built: build.Built, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While the first of them begins, the kernels of the later stages are compiled."""
    ahead: list[Any] = []
    real = build.compile_ahead
    monkeypatch.setattr(build, "compile_ahead", lambda *args: ahead.append(real(*args)))
    two = msgspec.structs.replace(small, motions=msgspec.structs.replace(small.motions, n_workers=2))
    again, _ = build.run(Job.of(ur3_cell(), two, cache=tmp_path), force=True)
    assert again.path.name == built.path.name
    assert again.path.read_bytes() == built.path.read_bytes()
    assert len(ahead) == 1


def test_motions_go_on_where_they_were(job: Job, built: build.Built, monkeypatch: pytest.MonkeyPatch) -> None:
    chunks = sorted(job.motions_dir.iterdir())
    assert len(chunks) == 2
    torn = chunks[1].read_bytes()
    chunks[1].write_bytes(torn[:-1])  # as a crash may leave it
    made: list[int] = []
    real = motion_store.MotionMaker.motion
    monkeypatch.setattr(motion_store.MotionMaker, "motion", lambda self, index: made.append(index) or real(self, index))
    again, _ = build.run(job)
    assert made == [30, 31, 32, 33]
    assert again.sha256 == built.sha256 and chunks[1].read_bytes() == torn


def test_other_configs_have_other_files(small: PlannerConfig, job: Job, cache: Path) -> None:
    cell = ur3_cell()
    paths = {job.path}
    for other in (
        Job.of(cell, msgspec.structs.replace(small, map=msgspec.structs.replace(small.map, seed=1)), cache=cache),
        Job.of(cell, msgspec.structs.replace(small, margins=msgspec.structs.replace(small.margins, safety_m=0.03)), cache=cache),
        Job.of(msgspec.structs.replace(cell, static=cell.static[:-1]), small, cache=cache),
        Job.of(cell, small, recorded=[np.zeros((2, 6))], cache=cache),
        Job.of(cell, msgspec.structs.replace(small, clearance=ClearanceConfig(layers_m=[0.02])), cache=cache),
        Job.of(cell, msgspec.structs.replace(small, clearance=ClearanceConfig(block_m=0.02)), cache=cache),
    ):
        assert other.path not in paths
        paths.add(other.path)
    slower = msgspec.structs.replace(small, speed=msgspec.structs.replace(small.speed, velocity=0.5))
    assert Job.of(cell, slower, cache=cache).path == job.path, "driving slower needs no new map"
    bolder = msgspec.structs.replace(small, clearance=ClearanceConfig(weight=0.0))
    assert Job.of(cell, bolder, cache=cache).path == job.path, "nor does what nearness costs"


def test_a_foreign_artefact_under_our_name_is_refused_and_replaced(
    small: PlannerConfig, job: Job, built: build.Built, tmp_path: Path
) -> None:
    grid = msgspec.structs.replace(ur3_cell().grid, resolution_m=0.04, shape=[40, 40, 25])
    theirs = Job.of(msgspec.structs.replace(ur3_cell(), grid=grid), small, cache=tmp_path)
    theirs.path.write_bytes(built.path.read_bytes())
    with pytest.raises(ArtefactError, match="another grid"):
        build.load(theirs)


def test_recorded_motions_join_the_map(small: PlannerConfig, job: Job, cache: Path) -> None:
    home = job.scene.robot.home_rad
    path = np.array([home, home + np.array([0.0, -0.4, 0.0, 0.4, 0.0, 2.5])])
    taught = Job.of(ur3_cell(), small, recorded=[path], cache=cache)
    learned = build.run(taught)[0]
    assert learned.figures["trajectories"] == 35
    middle = path.mean(axis=0)
    distance = [np.linalg.norm(m.learned.q_rad - middle, axis=1).min() for m in (learned, build.load(job))]
    assert distance[0] < 0.5 * distance[1]


def test_taught_files_are_named_by_the_config_or_given_and_make_the_same_map(small: PlannerConfig, cache: Path, tmp_path: Path) -> None:
    q = np.linspace(ur3().home_rad, ur3().home_rad + 0.3, 20)
    file = tmp_path / "taught.json"
    write_taught(file, TaughtMotion(np.arange(20.0), q), ur3())
    named = Job.of(ur3_cell(), msgspec.structs.replace(small, taught=[str(file)]), cache=cache)
    given = Job.of(ur3_cell(), small, recorded=[file], cache=cache)
    assert named.path == given.path == Job.of(ur3_cell(), small, recorded=[q], cache=cache).path
    assert named.path != Job.of(ur3_cell(), small, cache=cache).path
    file.write_text(file.read_text()[:-1])
    with pytest.raises(ConfigError, match=r"taught\.json: torn"):
        Job.of(ur3_cell(), msgspec.structs.replace(small, taught=[str(file)]), cache=cache)
