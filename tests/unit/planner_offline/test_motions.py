from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.errors import ConfigError, TolmanError
from common.geometry.grid import Grid
from services.planner.config import PlannerConfig
from services.planner.offline.config import RegionConfig
from services.planner.offline.motion_store import read_recorded
from services.planner.offline.motions import MotionMaker, resample
from services.planner.offline.regions import box_cells, tool_pose_in
from services.planner.offline.scene import Scene
from tests.support.cell import ur3
from tests.unit.planner_offline.conftest import PICK, PLACE

GRID = Grid((-0.8, -0.8, 0.0), (80, 80, 50), 0.02)


def inside(region: RegionConfig, T: np.ndarray) -> bool:
    return bool(np.all(T[:3, 3] >= np.array(region.min_m) - 1e-6) and np.all(T[:3, 3] <= np.array(region.max_m) + 1e-6))


@pytest.fixture(scope="module")
def maker(scene: Scene, small: PlannerConfig) -> MotionMaker:
    return MotionMaker(scene, small.motions)


def test_motions_reach_between_the_regions_and_are_free(scene: Scene, maker: MotionMaker) -> None:
    checker = scene.planner()
    empty = scene.world(checker, np.empty(0, dtype=np.int32))
    across = 0
    for index in range(12):
        path = maker.motion(index)
        ends = [scene.robot.tool_pose(q) for q in path[[0, -1]]]
        at = ["pick" if inside(PICK, T) else "place" if inside(PLACE, T) else "home" for T in ends]
        assert all(np.array_equal(q, scene.robot.home_rad) for q, where in zip(path[[0, -1]], at, strict=True) if where == "home")
        across += set(at) == {"pick", "place"}
        assert all(checker.is_free(empty, q) and scene.robot.limit_violation(q) is None for q in path)
    assert across >= 5


def test_a_motion_depends_on_its_index_and_seed_alone(scene: Scene, small: PlannerConfig, maker: MotionMaker) -> None:
    import msgspec

    wanted = {index: maker.motion(index).tobytes() for index in (0, 1, 2)}
    other_order = MotionMaker(scene, small.motions)
    assert {index: other_order.motion(index).tobytes() for index in (2, 0, 1)} == wanted
    other_seed = MotionMaker(scene, msgspec.structs.replace(small.motions, seed=1))
    assert other_seed.motion(0).tobytes() != wanted[0]


def test_regions_out_of_reach_are_an_error_that_names_them(scene: Scene, small: PlannerConfig) -> None:
    import msgspec

    far = RegionConfig(min_m=[2.0, 2.0, 0.1], max_m=[2.1, 2.1, 0.2])
    with pytest.raises(TolmanError, match=r"2\.0, 2\.0") as caught:
        MotionMaker(scene, msgspec.structs.replace(small.motions, pick=far, place=far)).motion(0)
    assert caught.value.code == "unreachable"


def test_tool_poses_point_down_into_the_region() -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        T = tool_pose_in(PICK, rng)
        assert inside(PICK, T)
        assert T[2, 2] <= -np.cos(PICK.tilt_max_rad) + 1e-9
        np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-12)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_box_cells_are_those_that_the_box_overlaps(seed: int) -> None:
    rng = np.random.default_rng(seed)
    low = rng.uniform([-1.0, -1.0, -0.2], [0.7, 0.7, 0.9])
    high = low + rng.uniform(0.03, 0.3, size=3)
    centres = GRID.centres(np.arange(GRID.n_cells))
    overlap = np.all((centres + 0.01 > low + 1e-9) & (centres - 0.01 < high - 1e-9), axis=1)
    np.testing.assert_array_equal(box_cells(GRID, low, high), np.flatnonzero(overlap))


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(50, 3000))
def test_resampling_gives_enough_equal_steps_on_the_paths(seed: int, n_samples: int) -> None:
    rng = np.random.default_rng(seed)
    paths = [rng.normal(size=(rng.integers(2, 7), 3)) for _ in range(rng.integers(1, 6))]
    samples = resample(paths, n_samples)
    assert n_samples <= len(samples.q_rad) <= n_samples + 2 * len(paths)
    assert samples.starts[0] == 0 and len(samples.starts) == len(paths)
    ends = [*samples.starts[1:], len(samples.q_rad)]
    for path, first, last in zip(paths, samples.starts, ends, strict=True):
        piece = samples.q_rad[first:last]
        np.testing.assert_allclose(piece[[0, -1]], path[[0, -1]], atol=1e-12)
        straight = np.linalg.norm(np.diff(piece, axis=0), axis=1)
        assert straight.max() <= np.linalg.norm(np.diff(path, axis=0), axis=1).sum() / (len(piece) - 1) + 1e-9


def test_paths_without_length_cannot_be_sampled() -> None:
    with pytest.raises(ValueError, match="every path is a point"):
        resample([np.zeros((2, 6))], 100)


def test_recorded_motions_are_read_or_refused_by_name(tmp_path) -> None:
    q = np.linspace(0, 1, 18).reshape(3, 6)
    np.savetxt(tmp_path / "good.csv", q, delimiter=",")
    np.save(tmp_path / "good.npy", q)
    for name in ("good.csv", "good.npy"):
        np.testing.assert_allclose(read_recorded(tmp_path / name, ur3()), q)
    (tmp_path / "words.csv").write_text("a,b\n")
    np.save(tmp_path / "narrow.npy", q[:, :5])
    np.save(tmp_path / "nan.npy", np.full((3, 6), np.nan))
    for name in ("words.csv", "narrow.npy", "nan.npy", "missing.csv"):
        with pytest.raises(ConfigError, match=name):
            read_recorded(tmp_path / name, ur3())
    np.save(tmp_path / "far.npy", np.vstack([q, np.full(6, 7.0)]))
    with pytest.raises(ConfigError, match=r"far\.npy: row 3: shoulder_pan_joint: 7 rad is outside its limits"):
        read_recorded(tmp_path / "far.npy", ur3())
