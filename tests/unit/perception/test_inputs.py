"""Back-projection against the formula, broken exposures by name, the config, and the margins of single links."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest

import services.perception
from common.cell import load
from common.errors import ConfigError
from common.geometry.transforms import invert, look_at
from services.perception.adapters.back_projection import back_project
from services.perception.config import PerceptionConfig
from services.perception.core.arm import margins_of
from services.perception.core.camera_view import problem_of_exposure

T = look_at([0.8, 0.8, 1.0], [0.0, 0.0, 0.25])
GOOD = {
    "width": 40, "height": 30, "fx_px": 30.0, "fy_px": 31.0, "cx_px": 19.0, "cy_px": 15.0, "T_world_camera": T,
    "depth_mm": np.full((30, 40), 900, np.uint16),
}  # fmt: skip


def test_points_are_where_the_formula_says() -> None:
    rng = np.random.default_rng(0)
    depth = rng.integers(0, 4000, (30, 40)).astype(np.uint16)
    depth[::3] = 0
    points = back_project(depth, 30.0, 31.0, 19.0, 15.0, invert(T), 3.0)
    v, u = np.nonzero((depth > 0) & (depth < 3000))
    z = depth[v, u] / 1000.0
    camera = np.stack([(u - 19.0) / 30.0 * z, (v - 15.0) / 31.0 * z, z], axis=1)
    expected = camera @ T[:3, :3].T + T[:3, 3]
    order = np.lexsort(np.round(points, 4).T)
    expected_order = np.lexsort(np.round(expected.astype(np.float32), 4).T)
    assert len(points) == len(expected)
    np.testing.assert_allclose(np.sort(points.sum(axis=1)), np.sort(expected.sum(axis=1)), atol=1e-5)
    np.testing.assert_allclose(points[order].mean(axis=0), expected[expected_order].mean(axis=0), atol=1e-5)


def test_a_sound_exposure_has_no_problem() -> None:
    assert problem_of_exposure(**GOOD) is None


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"width": 0}, "0 x 30"),
        ({"width": 41}, "(30, 41)"),
        ({"depth_mm": np.zeros((40, 30), np.uint16)}, "(40, 30)"),
        ({"depth_mm": np.zeros(1200, np.uint16)}, "(1200,)"),
        ({"fx_px": 0.0}, "intrinsics"),
        ({"cx_px": float("nan")}, "intrinsics"),
        ({"T_world_camera": np.full((4, 4), np.nan)}, "finite"),
        ({"T_world_camera": np.eye(3)}, "4x4"),
        ({"T_world_camera": np.diag([1.0, 1.0, -1.0, 1.0])}, "rigid"),
        ({"T_world_camera": np.diag([2.0, 2.0, 2.0, 1.0])}, "rigid"),
    ],
)
def test_a_broken_exposure_is_named(change: dict[str, object], named: str) -> None:
    assert named in (problem_of_exposure(**{**GOOD, **change}) or "")


@pytest.mark.parametrize(
    ("override", "named"),
    [("perception.min_point=3", "min_point"), ("perception.max_age_s=0", "max_age_s"), ("perception.cameras=[]", "cameras")],
)
def test_a_wrong_value_is_an_error_that_names_it(override: str, named: str) -> None:
    with pytest.raises(ConfigError, match=named):
        load(None, "perception", PerceptionConfig, [override])


def test_each_link_may_have_its_own_margin() -> None:
    margins = margins_of(["base", "tool"], 0.01, {"tool": 0.03})
    assert not isinstance(margins, str)
    np.testing.assert_array_equal(margins, [0.01, 0.03])
    assert "elbow" in str(margins_of(["base", "tool"], 0.01, {"elbow": 0.03}))


def test_perception_never_names_the_ground_truth() -> None:
    """Neither the key nor the message of the scene occurs in its code."""
    sources = sorted(Path(services.perception.__file__).parent.rglob("*.py"))
    assert len(sources) > 10
    for source in sources:
        names = {node.id for node in ast.walk(ast.parse(source.read_text())) if isinstance(node, ast.Name)}
        strings = {node.value for node in ast.walk(ast.parse(source.read_text())) if isinstance(node, ast.Constant)}
        assert not {"Scene", "Obstacle", "SetObstacle"} & names, source
        assert not {"robot/scene", "robot/**", "robot/*", "**"} & strings, source
