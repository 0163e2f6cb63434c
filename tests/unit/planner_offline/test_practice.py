"""A map that practises: it only grows, by ways that are free, and answers afterwards what it could not."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from services.planner.config import PlannerConfig
from services.planner.core.cognitive_map import CognitiveMap, components
from services.planner.core.find import PathFinder
from services.planner.core.found import FoundPath
from services.planner.core.lookup import LookupTable
from services.planner.core.roadmap import Roadmap
from services.planner.core.route import Route
from services.planner.core.two_trees import Joined
from services.planner.core.world import World, no_cells
from services.planner.kernels.connect import NO_WAY
from services.planner.offline import practice
from services.planner.offline.build import Job, run
from services.planner.offline.config import PracticeConfig
from services.planner.offline.exercises import Exercise, Exercises, exercises_among_boxes
from services.planner.offline.finishing import table_of
from services.planner.offline.motions import MotionMaker
from services.planner.offline.practice import before_practice, n_to_practise, practise
from services.planner.offline.scene import Scene
from tests.support.cell import ur3_cell

TABLE = ("node_offset", "node_owner", "edge_offset", "edge_owner", "unavoidable")


@pytest.fixture(scope="module")
def config(small: PlannerConfig) -> PlannerConfig:
    return msgspec.structs.replace(small, practice=PracticeConfig(share=0.4, exercises_per_neuron=2.0))


@pytest.fixture(scope="module")
def before(config: PlannerConfig, tmp_path_factory: pytest.TempPathFactory) -> tuple[Roadmap, list[np.ndarray]]:
    """The gas alone, and motions whose ends are practised."""
    alone = msgspec.structs.replace(before_practice(config), practice=PracticeConfig(share=0.0))
    job = Job.of(ur3_cell(), alone, cache=tmp_path_factory.mktemp("cache"))
    built = run(job)[0]
    assert "exercises" not in built.figures
    maker = MotionMaker(job.scene, config.motions)
    return Roadmap.of(built.learned, built.table, "gng"), [maker.motion(k) for k in range(12)]


def _exercises(scene: Scene, config: PlannerConfig, paths: list[np.ndarray]) -> Exercises:
    return exercises_among_boxes(MotionMaker(scene, config.motions), paths, 0)


@pytest.fixture(scope="module")
def practised(scene: Scene, config: PlannerConfig, before: tuple[Roadmap, list[np.ndarray]]) -> practice.Practised:
    roadmap, paths = before
    return practise(scene, config, roadmap, lambda: _exercises(scene, config, paths), np.vstack(paths))


def test_it_only_grows_and_stays_whole(
    scene: Scene, config: PlannerConfig, before: tuple[Roadmap, list[np.ndarray]], practised: practice.Practised
) -> None:
    roadmap, learned = before[0], practised.learned
    assert (roadmap.n_neurons, learned.n_neurons) == (90, 150)
    assert practised.n_lessons >= 3 and 0 < practised.n_neurons <= 60 and practised.n_unanswered >= practised.n_lessons // 3
    np.testing.assert_array_equal(learned.q_rad[:90], roadmap.neurons_rad)
    np.testing.assert_array_equal(learned.edges[: roadmap.n_edges], roadmap.edges)
    assert len(np.unique(components(learned.n_neurons, learned.edges))) == 1
    assert len(np.unique(learned.edges, axis=0)) == len(learned.edges)
    checker, nothing = scene.checker(), no_cells(scene.grid)
    assert all(checker.segment(nothing, learned.q_rad[a], learned.q_rad[b]) for a, b in learned.edges)


def test_its_table_is_the_one_built_from_nothing(scene: Scene, config: PlannerConfig, practised: practice.Practised) -> None:
    fresh = table_of(scene, config, practised.learned, lambda _share: None)
    for name in TABLE:
        np.testing.assert_array_equal(getattr(practised.table, name), getattr(fresh, name), err_msg=name)
    for name, array in fresh.layers.arrays().items():
        np.testing.assert_array_equal(practised.table.layers.arrays()[name], array, err_msg=name)


def test_it_answers_more_than_before(
    scene: Scene, config: PlannerConfig, before: tuple[Roadmap, list[np.ndarray]], practised: practice.Practised
) -> None:
    roadmap, paths = before
    exercises = _exercises(scene, config, paths)
    asked = [exercise for k in range(practised.n_exercises) if (exercise := exercises(k)) is not None]
    n_before = sum(_is_answered(scene, roadmap, exercise) for exercise in asked)
    n_after = sum(_is_answered(scene, Roadmap.of(practised.learned, practised.table, "gng"), exercise) for exercise in asked)
    assert n_after >= n_before + 3


def _is_answered(scene: Scene, roadmap: Roadmap, exercise: Exercise) -> bool:
    counts = roadmap.counts(scene.grid)
    counts.set_cells(exercise.cells)
    finder, world = PathFinder(roadmap, scene.checker()), World.of(scene.grid, counts)
    route, status, _, _ = Route.ask(finder, world, exercise.q_start, exercise.q_goal, "dijkstra")
    return status != NO_WAY and isinstance(route.find(), FoundPath)


def test_a_pocket_that_nothing_joins_becomes_an_island(
    scene: Scene, config: PlannerConfig, before: tuple[Roadmap, list[np.ndarray]]
) -> None:
    """The UR3's shoulder turned right over, above the table behind it: joint limits and table cut that off from all else."""
    roadmap, paths = before
    pocket = np.array([[2.41, 3.09, 1.07, -2.73, 1.63, 1.50], [-2.31, 3.09, 1.30, -2.80, 1.70, -0.30]])
    checker, nothing = scene.checker(), no_cells(scene.grid)
    assert checker.segment(nothing, *pocket) and not any(checker.segment(nothing, pocket[0], q) for q in roadmap.neurons_rad)
    exercises = _exercises(scene, config, [pocket])
    asked = [exercise for k in range(60) if (exercise := exercises(k)) is not None]
    done = practise(scene, config, roadmap, lambda: exercises, np.vstack(paths))
    assert done.n_islands >= 1
    after = Roadmap.of(done.learned, done.table, "gng")
    assert sum(_is_answered(scene, after, e) for e in asked) > sum(_is_answered(scene, roadmap, e) for e in asked)


def test_threads_change_nothing(
    scene: Scene,
    config: PlannerConfig,
    before: tuple[Roadmap, list[np.ndarray]],
    practised: practice.Practised,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    roadmap, paths = before
    monkeypatch.setattr(practice, "N_THREADS", 1)
    again = practise(scene, config, roadmap, lambda: _exercises(scene, config, paths), np.vstack(paths))
    assert again.learned.q_rad.tobytes() == practised.learned.q_rad.tobytes()
    assert again.learned.edges.tobytes() == practised.learned.edges.tobytes()


def test_only_what_lies_beside_the_map_is_learned() -> None:
    """Neurons 0 - 1 - 2 on a line; start and goal join them straight, a detour of two points leaves the map between 1 and 2."""
    none = np.zeros((1, 2), dtype=np.int64)
    table = LookupTable(none, np.empty(0, np.uint16), none, np.empty(0, np.uint16), np.empty(0, np.int32))
    q = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    roadmap = Roadmap.of(CognitiveMap(q, np.array([[0, 1], [1, 2]], dtype=np.int32)), table, "gng")
    detour = [[1.0, 1.0], [2.0, 1.0]]
    way = Joined(np.array([[0.0, -1.0], *q[:2].tolist(), *detour, q[2].tolist(), [2.0, -1.0]]), np.array([0, 1, -1, -1, 2], np.int32))
    (stretch,) = practice._beside_the_map(roadmap, way)
    np.testing.assert_array_equal(stretch, [[1.0, 0.0], *detour, [2.0, 0.0]])
    off = Joined(np.array([[0.0, -1.0], [0.5, -1.0], q[1].tolist(), [1.0, -1.0]]), np.array([-1, 1], np.int32))
    (stretch,) = practice._beside_the_map(roadmap, off)
    np.testing.assert_array_equal(stretch, [[0.0, -1.0], [0.5, -1.0], [1.0, 0.0]])
    assert practice._beside_the_map(roadmap, Joined(q[[0, 0, 1, 1]], np.array([0, 1], np.int32))) == []


def test_a_lattice_and_a_share_of_nothing_do_not_practise(small: PlannerConfig) -> None:
    assert n_to_practise(small) == 15 and before_practice(small).map.n_neurons == 135
    assert n_to_practise(msgspec.structs.replace(small, model="som")) == 0
    alone = msgspec.structs.replace(small, practice=PracticeConfig(share=0.0))
    assert n_to_practise(alone) == 0 and before_practice(alone).map == small.map
