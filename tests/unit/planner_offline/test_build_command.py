"""``tolman build`` as a person types it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from clients.cli.main import main
from common.robot.model import cache_dir
from tests.support.cell import ur3

SMALL = [
    "--set=planner.map.n_neurons=100",
    "--set=planner.motions.n_trajectories=10",
    "--set=planner.motions.n_samples=600",
    "--set=planner.motions.n_workers=1",
]


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache, but for the arm's distance grids, which take seconds to make."""
    kept = tmp_path / "tolman"
    kept.mkdir()
    shutil.copy(cache_dir() / f"geometry-{ur3().fingerprint}.npz", kept)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return kept


def test_builds_once_reports_and_finds_it_again(tmp_path: Path, cache: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report = tmp_path / "report.json"
    assert main(["build", *SMALL, f"--json={report}"]) == 0
    told = json.loads(report.read_text())
    assert (told["trajectories"], told["neurons"], told["components"]) == (10, 100, 1)
    wanted = {"samples", "edges", "quantisation_error_rad", "table_bytes", "seconds", "sha256", "machine", "commit", "seed", "config"}
    assert wanted <= set(told)
    kept = list(cache.glob("map-*.tolman"))
    assert len(kept) == 1 and str(kept[0]) in capsys.readouterr().out

    stamp = kept[0].stat().st_mtime_ns
    assert main(["build", *SMALL]) == 0
    assert kept[0].stat().st_mtime_ns == stamp and "was there already" in capsys.readouterr().out

    whole = kept[0].read_bytes()
    kept[0].write_bytes(whole[:1000])
    assert main(["build", *SMALL]) == 0
    assert "torn" in capsys.readouterr().err and kept[0].read_bytes() == whole


def test_recorded_motions_are_learned_and_bad_ones_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good, bad = tmp_path / "wave.csv", tmp_path / "bad.csv"
    np.savetxt(good, np.linspace([0, -1.5, 1.5, -1.5, -1.5, 0], [0.5, -1.2, 1.2, -1.5, -1.5, 0], 20), delimiter=",")
    bad.write_text("1,2,3\n")
    assert main(["build", *SMALL, "--motions", str(good), f"--json={tmp_path / 'r.json'}"]) == 0
    assert json.loads((tmp_path / "r.json").read_text())["trajectories"] == 11
    assert main(["build", *SMALL, "--motions", str(bad)]) != 0
    assert "bad.csv" in capsys.readouterr().err
