"""The report of ``tolman bench solve``: pooled over its folds, and gone on with only by an equal run."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.solve_report import Fold, SolveReport
from benchmarks.solving import Record
from common.errors import ConfigError

RECORD = Record("s", 1, "solved", "solved", "map", "found", 2.0, 6.0, 5.0, False, 100)
HEADER = {"commit": "abc", "date": "today", "config": {"step_m": 0.002}, "folds": 2}
FOLDS = [
    Fold({"fold": 1, "asked": 2}, [RECORD, replace(RECORD, set_name="t", way=None, length_rad=None, reference_rad=None)]),
    Fold({"fold": 0, "asked": 1}, [replace(RECORD, index=2, way="repair", collides=True)]),
]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "report.json"
    SolveReport(HEADER, list(FOLDS)).write(path)
    return path


def test_shares_are_of_all_folds_together(path: Path) -> None:
    told = json.loads(path.read_text())
    assert list(told["sets"]) == ["s", "t", "all"] and told["sets"]["all"]["n_total"] == 3
    assert told["sets"]["s"]["solved_share"]["map"] == 0.5 and told["sets"]["s"]["collisions"] == 1
    assert [m["all"]["n_total"] for m in told["maps"]] == [2, 1]
    assert [(p["fold"], p["index"]) for p in told["problems"]] == [(1, 1), (1, 1), (0, 2)]


def test_an_equal_run_goes_on_with_what_was_written(path: Path) -> None:
    later = SolveReport({**HEADER, "date": "tomorrow"})
    later.go_on(path)
    assert later.folds == FOLDS and later.kept(0) and later.kept(1) and not later.kept(2)
    before = path.read_bytes()
    replace(later, header=HEADER).write(path)
    assert path.read_bytes() == before


def test_another_run_does_not(path: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"its config is \{'step_m': 0.002\}, now it is \{'step_m': 0.001\}"):
        SolveReport({**HEADER, "config": {"step_m": 0.001}}).go_on(path)
    with pytest.raises(ConfigError, match="no report to go on with"):
        SolveReport(HEADER).go_on(tmp_path / "nowhere.json")
    path.write_text("[]")
    with pytest.raises(ConfigError, match="no report to go on with"):
        SolveReport(HEADER).go_on(path)
