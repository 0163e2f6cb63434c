"""``tolman bench sizes`` from end to end, on two tiny maps."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.sizes import Size, at_size, questions_at_size
from clients.cli.main import main
from common.cell import load
from services.planner.config import PlannerConfig

MOTIONS = ["--override=planner.motions.n_trajectories=8", "--override=planner.motions.n_samples=600"]


@pytest.mark.batch
def test_each_size_is_built_asked_and_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    told, png = tmp_path / "sizes.json", tmp_path / "sizes.png"
    command = ["bench", "sizes", "--neurons", "60", "120", "--cells", "0.04", "--n", "3", *MOTIONS, "--json", str(told), "--plot", str(png)]
    assert main([*command, "--force"]) == 0
    first = json.loads(told.read_text(encoding="utf-8"))
    small, large = first["sizes"]
    assert (small["neurons"], large["neurons"]) == (60, 120) and small["cell_m"] == large["cell_m"] == 0.04
    assert 0 < small["table_bytes"] < large["table_bytes"] and 0 < small["layer_bytes"] < large["layer_bytes"]
    for row in (small, large):
        assert set(row["build_s"]) == {"motions", "map", "prune", "table", "practice", "write", "total"}
        assert row["components"] == 1 and row["n_questions"] == 3 and 0 <= row["n_solved"] <= row["n_solvable"] <= 3
        assert row["artefact_bytes"] > row["table_bytes"] + row["layer_bytes"]
        assert row["build_peak_bytes"] > 10_000_000 and row["planner_bytes"] > 10_000_000
        assert row["n_solved"] == 0 or 0.0 < row["connect_search_ms"]["p50"] <= row["answer_ms"]["p50"]
    assert png.read_bytes().startswith(b"\x89PNG")
    assert main(command) == 0
    again = json.loads(told.read_text(encoding="utf-8"))["sizes"]
    assert [row["build_s"] for row in again] == [row["build_s"] for row in first["sizes"]], "a map that is there is not built again"
    assert len(capsys.readouterr().out.splitlines()) == 6
    size = at_size(*load(None, "planner", PlannerConfig, [part.removeprefix("--override=") for part in MOTIONS]), Size(60, 0.04))
    for told_of_all in (True, False):
        figures, solvable = questions_at_size(*size, "60", 3, 0, dict.fromkeys(range(3), told_of_all))
        expected = 3 if told_of_all else figures["n_solved"]
        assert figures["n_solvable"] == sum(solvable.values()) == expected, "what is known is not proven anew"
