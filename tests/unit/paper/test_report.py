"""The report is a function of the kept sections: every number, verdict, figure and missing part stands in both forms."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import pytest
from PIL import Image

from benchmarks.paper.experiment import Experiment
from benchmarks.paper.outcome import HOLDS, NOT, Figure, Outcome, Table, Verdict
from benchmarks.paper.report.section import Section, read_sections, write_section
from benchmarks.paper.report.write import keep_copy, write_report
from benchmarks.provenance import provenance
from common.errors import ArtefactError


def section(name: str, group: str, outcome: Outcome, scale: str = "full") -> Section:
    part = Experiment(name, group, f"Title of {name}", lambda study: outcome)  # type: ignore[arg-type]
    header = provenance(7, {"scale": scale})
    return Section.of(
        part, outcome, [Figure("a-figure", "What it shows")], scale=scale, only="", seconds=1.5, load=[0.5, 2.5], provenance=header
    )


@pytest.fixture
def report(tmp_path: Path) -> Path:
    table = Table("A table", ("what", "ours | theirs"), [["length", "**3** of 4"]], "How to *read* it.")
    verdicts = [
        Verdict("Less is shorter", "13 ms", "12.5 ms of 20", HOLDS),
        Verdict("More is longer", "not at hand", "no <b>", NOT, "Because."),
    ]
    rows = [{"row": "gng", "ms": 1.25, "n": 3}, {"row": "som", "ms": float("nan"), "collides": True}]
    write_section(section("table1", "tables", Outcome("How.", rows=rows, tables=[table])), tmp_path)
    write_section(section("gng-shorter", "claims", Outcome("Why.", verdicts=verdicts)), tmp_path)
    write_report(tmp_path, ["table1", "table2", "gng-shorter"])
    return tmp_path


@pytest.mark.parametrize("form", ["report.md", "report.html"])
def test_both_forms_hold_everything(report: Path, form: str) -> None:
    text = (report / form).read_text(encoding="utf-8")
    wanted = [
        "Title of table1",
        "A table",
        "length",
        "Title of gng-shorter",
        "12.5 ms of 20",
        "does not hold",
        "Because.",
        "a-figure",
        "table2",
    ]
    assert [word for word in wanted if word not in text] == []
    assert "holds: 1, does not hold: 1" in text


def test_html_escapes_what_it_shows(report: Path) -> None:
    assert "no &lt;b&gt;" in (report / "report.html").read_text(encoding="utf-8")


def test_raw_rows_are_kept_with_seed_config_machine_and_commit(report: Path) -> None:
    kept = json.loads((report / "data" / "table1.json").read_text(encoding="utf-8"))
    assert kept["rows"][0] == {"row": "gng", "ms": 1.25, "n": 3}
    assert kept["rows"][1]["ms"] is None  # JSON has no NaN
    assert kept["provenance"]["seed"] == 7
    assert {"machine", "commit", "config"} <= set(kept["provenance"])
    with (report / "data" / "table1.csv").open(encoding="utf-8") as file:
        assert next(csv.DictReader(file))["ms"] == "1.25"


def test_a_quick_section_makes_the_report_say_so(report: Path) -> None:
    assert "quick run" not in (report / "report.md").read_text(encoding="utf-8")
    write_section(section("table2", "tables", Outcome("How."), scale="quick"), report)
    for path in write_report(report, ["table1", "table2"]):
        assert "quick run" in path.read_text(encoding="utf-8")


def test_a_kept_copy_links_nothing_that_it_does_not_hold(report: Path, tmp_path: Path) -> None:
    (report / "figures").mkdir()
    Image.new("RGB", (3000, 30), "red").save(report / "figures" / "a-figure.png")
    copy = keep_copy(report, ["table1", "gng-shorter"], tmp_path / "copy")
    text = copy.read_text(encoding="utf-8")
    links = re.findall(r"\]\(([^)]+)\)", text)
    assert links
    assert all((copy.parent / link).exists() for link in links)
    assert "12.5 ms of 20" in text
    assert Image.open(copy.parent / "figures" / "a-figure.png").width < 1500


def test_sections_come_in_the_order_of_the_report(report: Path) -> None:
    assert [s.name for s in read_sections(report, ["gng-shorter", "nothing", "table1"])] == ["gng-shorter", "table1"]


def test_a_torn_section_is_an_error_that_names_the_file(report: Path) -> None:
    (report / "data" / "table1.json").write_text("{", encoding="utf-8")
    with pytest.raises(ArtefactError, match=r"table1\.json"):
        read_sections(report, ["table1"])
