"""``tolman bench peers`` from end to end, on few questions and a small map."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.paper.scale import QUICK
from benchmarks.side_by_side import KINDS, OURS
from clients.cli.main import main

N, PEERS = 3, ("ompl_rrt_connect", "roboplan_rrt_connect")


@pytest.mark.batch
def test_ours_and_peers_stand_side_by_side(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    small = [f"--override={value}" for value in QUICK.overrides]
    command = ["bench", "peers", "--n", str(N), "--limit-s", "1", "--peers", *PEERS, "--json", str(tmp_path / "r.json"), *small]
    assert main(command) == 0
    told = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    assert {"machine", "commit", "seed", "config", "set", "limit_s", "peers_better"} <= set(told)
    assert list(told["planners"]) == [OURS, *PEERS]
    assert len(told["attempts"]) == N * (len(KINDS) + 2 * len(PEERS))
    assert told["n_questions"] == N and 1 <= told["n_solvable"] <= N
    for name in PEERS:
        raw, smoothed = (told["planners"][name][kind] for kind in ("raw", "smoothed"))
        assert raw["n_solved"] == smoothed["n_solved"] >= 1
        assert raw["time_ms"]["p50"] < smoothed["time_ms"]["p50"], "simplifying takes time"
        assert smoothed["length_rad_median"] <= raw["length_rad_median"]
    ours = told["planners"][OURS]
    assert all(ours[kind]["collisions"] == 0 for kind in KINDS)
    printed = capsys.readouterr().out
    assert all(name in printed for name in told["planners"]) and all(line in " ".join(printed.split()) for line in told["peers_better"])
