"""Which cells a solid touches: coal is the referee of every cube near it, and a few that can be worked out by hand."""

from __future__ import annotations

import coal
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.cell import SolidConfig
from common.geometry.grid import Grid
from common.geometry.transforms import rpy_matrix
from services.planner.offline.solid_cells import solid_cells

GRID = Grid((-0.2, -0.2, -0.2), (20, 20, 20), 0.02)
UNSURE_M = 1e-5  # coal's own distances are good to about a micrometre


def test_a_box_on_cell_faces_takes_no_neighbour() -> None:
    box = SolidConfig(name="box", shape="box", size_m=[0.04, 0.02, 0.02], position_m=(0.0, 0.01, 0.01))
    assert sorted(solid_cells(GRID, [box])) == sorted(GRID.cells_of(np.array([[-0.01, 0.01, 0.01], [0.01, 0.01, 0.01]])))


def test_a_ball_takes_the_corner_cells_that_it_enters_only() -> None:
    def n_cells(radius_m: float) -> int:
        ball = SolidConfig(name="ball", shape="sphere", size_m=[radius_m], position_m=(0.01, 0.01, 0.01))
        return len(solid_cells(GRID, [ball]))

    assert n_cells(0.0099) == 1
    assert n_cells(0.0101) == 7  # over each face
    assert n_cells(0.01 * np.sqrt(2) + 1e-4) == 19  # over each edge
    assert n_cells(0.01 * np.sqrt(3) + 1e-4) == 27  # over each corner


def test_cells_of_several_solids_are_ascending_and_named_once() -> None:
    ball = SolidConfig(name="ball", shape="sphere", size_m=[0.05], position_m=(0.0, 0.0, 0.0))
    cells = solid_cells(GRID, [ball, ball])
    assert np.array_equal(cells, solid_cells(GRID, [ball])) and np.all(np.diff(cells) > 0)
    assert len(solid_cells(GRID, [])) == 0


def test_what_is_outside_the_grid_is_left_out() -> None:
    half_out = SolidConfig(name="box", shape="box", size_m=[1.0, 0.02, 0.02], position_m=(0.5, 0.01, 0.01))
    far = SolidConfig(name="far", shape="sphere", size_m=[0.1], position_m=(3.0, 0.0, 0.0))
    assert len(solid_cells(GRID, [half_out, far])) == 10


@settings(max_examples=25, deadline=None)
@given(
    shape=st.sampled_from(["box", "cylinder", "sphere"]),
    size=st.lists(st.floats(0.002, 0.2), min_size=3, max_size=3),
    position=st.lists(st.floats(-0.1, 0.1), min_size=3, max_size=3),
    rpy=st.lists(st.sampled_from([0.0, np.pi / 2, 0.3, -1.1, 2.0, 1e-7]), min_size=3, max_size=3),
)
def test_every_cell_as_coal_says(shape: str, size: list[float], position: list[float], rpy: list[float]) -> None:
    n = {"box": 3, "cylinder": 2, "sphere": 1}[shape]
    solid = SolidConfig(name="it", shape=shape, size_m=size[:n], position_m=tuple(position), rpy_rad=tuple(rpy))  # type: ignore[arg-type]
    ours = set(solid_cells(GRID, [solid]).tolist())
    theirs = {"box": coal.Box, "cylinder": coal.Cylinder, "sphere": coal.Sphere}[shape](*size[:n])
    T = rpy_matrix(solid.position_m, solid.rpy_rad)
    placed = coal.Transform3s(np.ascontiguousarray(T[:3, :3]), np.ascontiguousarray(T[:3, 3]))
    cube, request = coal.Box(0.02, 0.02, 0.02), coal.DistanceRequest()
    centres = GRID.centres(np.arange(GRID.n_cells))
    near = np.linalg.norm(centres - T[:3, 3], axis=1) < np.linalg.norm(size[:n]) + 0.04
    assert ours <= set(np.flatnonzero(near).tolist())
    rim = [c for c in np.flatnonzero(near) if _is_rim(c, ours)]
    for cell in np.random.default_rng(0).permutation(rim)[:300]:
        result = coal.DistanceResult()
        apart = coal.distance(cube, coal.Transform3s(np.eye(3), centres[cell]), theirs, placed, request, result)
        if abs(apart) > UNSURE_M:
            assert (apart < 0.0) == (int(cell) in ours), (solid, int(cell), apart)


def _is_rim(cell: int, ours: set[int]) -> bool:
    """Whether a cell and one of its neighbours are of different kinds: the others are easy."""
    steps = (1, 20, 400)
    return any((cell in ours) != (cell + sign * step in ours) for step in steps for sign in (-1, 1))


@pytest.mark.parametrize("shape", ["box", "cylinder", "sphere"])
def test_a_solid_smaller_than_a_cell_is_not_lost(shape: str) -> None:
    n = {"box": 3, "cylinder": 2, "sphere": 1}[shape]
    tiny = SolidConfig(name="tiny", shape=shape, size_m=[0.001] * n, position_m=(0.0143, 0.0057, -0.0111))  # type: ignore[arg-type]
    assert solid_cells(GRID, [tiny]).tolist() == GRID.cells_of(np.array([[0.0143, 0.0057, -0.0111]])).tolist()
