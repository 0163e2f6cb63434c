from __future__ import annotations

import importlib

import pytest

from benchmarks.paper.ask import variants
from benchmarks.paper.registry import GROUPS, NAMES, PARTS, experiment, resolve
from clients.cli.main import main
from common.errors import RequestError

# The rows of the issue: each must be there by name.
WANTED = {
    "tables": {"table1", "table2"},
    "figures": {"bitmaps", "samplers", "dodge", "two-link"},
    "claims": {
        "gng-shorter",
        "dijkstra-shorter",
        "big-obstacles",
        "solved-share",
        "smoothing-cost",
        "reproducible",
        "resolution",
        "table-memory",
        "clutter",
        "constraints",
        "extension",
    },
}


@pytest.mark.parametrize("group", WANTED)
def test_every_row_of_the_issue_is_a_part(group: str) -> None:
    assert set(GROUPS[group]) == WANTED[group]


@pytest.mark.parametrize("name", NAMES)
def test_every_part_can_be_loaded_and_draws_what_it_says(name: str) -> None:
    part = experiment(name)
    assert part.name == name
    assert callable(part.measure)
    assert (part.draw is not None) == PARTS[name].drawn


def test_no_module_of_an_experiment_is_left_out() -> None:
    named = {entry.module for entry in PARTS.values()}
    for module in named:
        assert hasattr(importlib.import_module(f"benchmarks.paper.{module}"), "measure")


def test_parts_and_groups_resolve_in_the_order_of_the_report() -> None:
    assert resolve([]) == list(NAMES)
    assert resolve(["all"]) == list(NAMES)
    assert resolve(["claims", "table1"]) == ["table1", *GROUPS["claims"]]
    assert resolve(["table2", "table1", "table2"]) == ["table1", "table2"]


def test_an_unknown_name_is_an_error_that_lists_the_known_ones() -> None:
    with pytest.raises(RequestError, match="did you mean table1") as error:
        resolve(["table1", "tabel1"])
    assert error.value.code == "unknown_part"
    assert all(name in error.value.message for name in NAMES)


def test_the_command_says_so_and_ends_with_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["paper", "nonsense"]) == 1
    assert "unknown_part" in capsys.readouterr().err


def test_the_command_lists_its_parts(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["paper", "--list"]) == 0
    shown = capsys.readouterr().out
    assert all(name in shown for name in NAMES)


def test_rows_are_chosen_by_name_and_an_unknown_one_is_an_error() -> None:
    assert [variant.name for variant in variants(("gng", "som"), only="gng-astar-raw")] == ["gng-astar-raw-paper", "gng-astar-raw-checked"]
    with pytest.raises(RequestError, match="rows are called like") as error:
        variants(("gng",), only="gnu")
    assert error.value.code == "unknown_row"
