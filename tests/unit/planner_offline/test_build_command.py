"""``tolman build`` as a person types it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from clients.cli.main import main
from common.cache import cache_dir
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
    ur3()
    for path in cache_dir().glob("geometry-*.npz"):
        (kept / path.name).symlink_to(path)
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


def test_a_box_on_a_small_map_is_measured(tmp_path: Path) -> None:
    report = tmp_path / "payload.json"
    overrides = [f"--override={one.removeprefix('--set=')}" for one in SMALL]
    assert main(["bench", "payload", "--n=1", f"--json={report}", *overrides]) == 0
    told = json.loads(report.read_text())
    assert told["n_neurons"] == 100 and 0.0 < told["kept_s"]["p50"] < told["new_s"]["p50"]
    assert {"machine", "commit", "config", "barred_neurons", "layer_bytes"} <= set(told)


def test_recorded_motions_are_learned_and_bad_ones_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good, bad = tmp_path / "wave.csv", tmp_path / "bad.csv"
    np.savetxt(good, np.linspace([0, -1.5, 1.5, -1.5, -1.5, 0], [0.5, -1.2, 1.2, -1.5, -1.5, 0], 20), delimiter=",")
    bad.write_text("1,2,3\n")
    assert main(["build", *SMALL, "--motions", str(good), f"--json={tmp_path / 'r.json'}"]) == 0
    assert json.loads((tmp_path / "r.json").read_text())["trajectories"] == 11
    assert main(["build", *SMALL, "--motions", str(bad)]) != 0
    assert "bad.csv" in capsys.readouterr().err


def test_a_kept_gas_is_extended_and_a_lattice_is_not(tmp_path: Path, cache: Path, capsys: pytest.CaptureFixture[str]) -> None:
    more = tmp_path / "more.csv"
    np.savetxt(more, np.linspace([1.8, -1.7, 1.5, -1.5, -1.5, 0], [2.8, -1.3, 1.1, -1.2, -1.5, 1], 20), delimiter=",")
    grown = [*SMALL, "--set=planner.extend.n_added=20"]
    assert main(["build", *grown]) == 0
    base = next(iter(cache.glob("map-*.tolman")))
    stamp = base.stat().st_mtime_ns
    assert main(["build", *grown, "--extend", str(more), f"--json={tmp_path / 'r.json'}"]) == 0
    assert "extended in" in capsys.readouterr().out
    told = json.loads((tmp_path / "r.json").read_text())
    assert (told["neurons_before"], told["neurons"], told["extended_by"]) == (100, 120, 1)
    assert base.stat().st_mtime_ns == stamp and len(list(cache.glob("map-*.tolman"))) == 2
    assert main(["build", *grown, f'--set=planner.extend.motions=["{more}"]']) == 0
    assert "was there already" in capsys.readouterr().out, "a config that names the files is served by the same map"

    assert main(["build", *SMALL, "--set=planner.model=som", "--extend", str(more)]) == 2
    assert "cannot_extend: [planner] model: a som has a fixed grid and cannot be extended" in capsys.readouterr().err
    assert main(["build", *grown, "--extend", str(tmp_path / "nothing.npy")]) == 2
    assert "nothing.npy" in capsys.readouterr().err
