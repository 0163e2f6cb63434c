"""``tolman bench sizes``: which maps are built, and from how many motions."""

from __future__ import annotations

import argparse
import os

import pytest

from benchmarks.bench_sizes import _apart, add_arguments, sizes_of
from benchmarks.sizes import Size, at_size
from clients.cli.main import main
from common.cell import CellConfig, load
from common.errors import RequestError, TolmanError
from services.planner.config import PlannerConfig


@pytest.fixture(scope="module")
def cell() -> tuple[CellConfig, PlannerConfig]:
    return load(None, "planner", PlannerConfig)


def asked(*words: str) -> list[Size]:
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    return sizes_of(parser.parse_args(words))


def test_all_sizes_of_the_issue_or_those_that_are_named() -> None:
    assert [str(size) for size in asked()] == [
        "1000 neurons, 2 cm",
        "10000 neurons, 2 cm",
        "30000 neurons, 2 cm",
        "100000 neurons, 2 cm",
        "10000 neurons, 1 cm",
        "10000 neurons, 4 cm",
    ]
    assert asked("--cells", "0.01", "0.04") == [Size(10_000, 0.01), Size(10_000, 0.04)]
    assert asked("--neurons", "50", "70", "--cells", "0.04") == [Size(50, 0.04), Size(70, 0.04)]


def test_larger_maps_are_made_from_more_motions_and_finer_ones(cell: tuple[CellConfig, PlannerConfig]) -> None:
    made = {}
    for n in (1_000, 10_000, 100_000):
        _, config = at_size(*cell, Size(n, 0.02))
        assert config.map.n_neurons == n
        made[n] = config.motions.n_trajectories, config.motions.n_samples
    assert made == {1_000: (1230, 50_000), 10_000: (1230, 50_000), 100_000: (3890, 500_000)}


def test_cells_of_another_size_fill_the_same_space(cell: tuple[CellConfig, PlannerConfig]) -> None:
    grids = {cell_m: at_size(*cell, Size(10_000, cell_m))[0].grid for cell_m in (0.01, 0.02, 0.04)}
    assert grids[0.02] == cell[0].grid
    assert [grids[cell_m].shape for cell_m in (0.01, 0.04)] == [(160, 160, 100), (40, 40, 25)]


@pytest.mark.parametrize(
    ("size", "named"), [(Size(10_000, 0.03), "--cells 0.03"), (Size(10_000, 0.0), "--cells 0"), (Size(3, 0.02), "--neurons 3")]
)
def test_a_size_that_cannot_be_is_refused_by_name(cell: tuple[CellConfig, PlannerConfig], size: Size, named: str) -> None:
    with pytest.raises(RequestError, match=named):
        at_size(*cell, size)


def test_no_questions_are_refused_before_anything_is_built(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "sizes", "--n", "0"]) == 1
    assert "--n 0" in capsys.readouterr().err


def test_a_process_that_was_ended_is_an_error_of_its_own() -> None:
    with pytest.raises(TolmanError, match="was ended"):
        _apart(os._exit, 9)
