from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from services.planner.core.rrt_connect import RrtConnect, RrtParameters
from services.planner.core.world import cells_of
from services.planner.kernels.rrt_connect import World, segment_is_free
from services.planner.kernels.xoshiro import uniform
from services.planner.offline.regions import box_cells
from services.planner.offline.scene import Scene
from tests.support.slow_xoshiro import SlowXoshiro

F64 = np.ndarray


def generator(seed: int) -> np.ndarray:
    return np.random.SeedSequence(seed).generate_state(4, np.uint64)


def clutter(scene: Scene) -> np.ndarray:
    low_and_high = [([0.25, -0.08, 0.1], [0.45, 0.08, 0.5]), ([-0.3, 0.2, 0.3], [-0.1, 0.4, 0.5])]
    return np.unique(np.concatenate([box_cells(scene.grid, np.array(a), np.array(b)) for a, b in low_and_high]))


@pytest.fixture(scope="module")
def planner(scene: Scene) -> RrtConnect:
    return scene.planner()


@pytest.fixture(scope="module")
def world(scene: Scene, planner: RrtConnect) -> World:
    return scene.world(planner, clutter(scene))


@pytest.fixture(scope="module")
def pairs(scene: Scene, planner: RrtConnect, world: World) -> list[tuple[F64, F64]]:
    """Pairs of free poses, tool above the table's front, whose straight motion is blocked."""
    rng = np.random.default_rng(2)
    found: list[tuple[F64, F64]] = []
    while len(found) < 12:
        a, b = rng.uniform([-1.5, -2.4, 0.2, -2.5, -2.0, -3.0], [1.5, -0.6, 2.2, 0.0, 2.0, 3.0], size=(2, 6))
        if planner.is_free(world, a) and planner.is_free(world, b) and not segment_is_free(world, a, b, 0.03):
            found.append((a, b))
    return found


def densely_free(planner: RrtConnect, world: World, path: F64, step_rad: float) -> bool:
    """The obvious check: every pose along the path, one after the other."""
    for a, b in itertools.pairwise(path):
        n = max(1, math.ceil(float(np.linalg.norm(b - a)) / step_rad))
        if not all(planner.is_free(world, a + (b - a) * (i / n)) for i in range(n + 1)):
            return False
    return True


def test_generator_equals_its_twin() -> None:
    state = generator(3)
    slow = SlowXoshiro([int(s) for s in state])
    assert [uniform(state) for _ in range(200)] == [slow.uniform() for _ in range(200)]


def test_segment_check_equals_the_obvious_one(planner: RrtConnect, world: World) -> None:
    rng = np.random.default_rng(8)
    verdicts = []
    while len(verdicts) < 60:
        a = rng.uniform([-1.5, -2.4, 0.2, -2.5, -2.0, -3.0], [1.5, -0.6, 2.2, 0.0, 2.0, 3.0])
        b = a + rng.normal(scale=0.25, size=6)
        if planner.is_free(world, a):
            verdicts.append(segment_is_free(world, a, b, 0.03))
            assert verdicts[-1] == densely_free(planner, world, np.array([a, b]), 0.03)
    assert 5 < sum(verdicts) < 55


def test_paths_are_free_join_the_ends_and_get_no_longer(
    scene: Scene, planner: RrtConnect, world: World, pairs: list[tuple[F64, F64]]
) -> None:
    closer = planner.world(cells_of(scene.grid, clutter(scene)), scene.margins.safety_m / 2.0)  # what is left between two looks of a motion
    n_solved = 0
    for i, (a, b) in enumerate(pairs):
        state = generator(i)
        path = planner.plan(world, a, b, state)
        if path is None:
            continue
        n_solved += 1
        shorter = planner.simplify(world, path, state)
        for p in (path, shorter):
            np.testing.assert_array_equal(p[[0, -1]], [a, b])
            assert densely_free(planner, closer, p, planner.parameters.step_rad / 3.0)
        length = [float(np.linalg.norm(np.diff(p, axis=0), axis=1).sum()) for p in (path, shorter)]
        assert length[1] <= length[0] + 1e-9
    assert n_solved >= 10


def test_equal_generators_give_equal_paths(scene: Scene, world: World, pairs: list[tuple[F64, F64]]) -> None:
    a, b = pairs[0]
    paths = []
    for seed in (5, 5, 6):
        planner = scene.planner()
        path = planner.plan(scene.world(planner, clutter(scene)), a, b, generator(seed))
        assert path is not None
        paths.append(path.tobytes())
    assert paths[0] == paths[1] != paths[2]


def test_ends_that_are_not_free_and_bounds_that_are_reached_give_none(scene: Scene, pairs: list[tuple[F64, F64]]) -> None:
    a, b = pairs[0]
    planner = scene.planner(RrtParameters(max_iterations=0))
    world = scene.world(planner, clutter(scene))
    assert planner.plan(world, a, b, generator(0)) is None
    below_the_table = np.array([0.0, 0.6, 0.3, 0.0, 0.0, 0.0])
    assert not planner.is_free(world, below_the_table)
    assert planner.plan(world, a, below_the_table, generator(0)) is None
    assert planner.plan(world, below_the_table, a, generator(0)) is None


def test_a_full_tree_ends_the_search(scene: Scene, pairs: list[tuple[F64, F64]]) -> None:
    planner = scene.planner(RrtParameters(max_nodes=2, max_iterations=200))
    world = scene.world(planner, clutter(scene))
    assert planner.plan(world, *pairs[0], generator(0)) is None


@pytest.mark.slow
def test_solves_as_much_as_ompl(scene: Scene, planner: RrtConnect, world: World, pairs: list[tuple[F64, F64]]) -> None:
    """The referee: OMPL's RRTConnect with the same check, half a second a question."""
    base, geometric = pytest.importorskip("ompl.base"), pytest.importorskip("ompl.geometric")
    space = base.RealVectorStateSpace(6)
    bounds = base.RealVectorBounds(6)
    for j in range(6):
        bounds.setLow(j, float(scene.robot.position_min_rad[j]))
        bounds.setHigh(j, float(scene.robot.position_max_rad[j]))
    space.setBounds(bounds)
    theirs = ours = 0
    for i, (a, b) in enumerate(pairs):
        setup = geometric.SimpleSetup(space)
        setup.setStateValidityChecker(lambda s: planner.is_free(world, np.array([s[j] for j in range(6)])))
        setup.getSpaceInformation().setStateValidityCheckingResolution(0.03 / space.getMaximumExtent())
        start, goal = space.allocState(), space.allocState()
        for j in range(6):
            start[j], goal[j] = float(a[j]), float(b[j])
        setup.setStartAndGoalStates(start, goal)
        setup.setPlanner(geometric.RRTConnect(setup.getSpaceInformation()))
        theirs += bool(setup.solve(2.0)) and setup.haveExactSolutionPath()
        ours += planner.plan(world, a, b, generator(i)) is not None
    assert ours >= theirs - 1
