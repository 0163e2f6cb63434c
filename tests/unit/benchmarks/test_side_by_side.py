"""Figures of ours beside a peer: what is counted, how failures count, and that a better peer is said to be better."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from benchmarks.side_by_side import KINDS, OURS, Attempt, better_than_ours, figures_of
from clients.cli.main import main

LIMIT_MS = 1000.0


def line(length_rad: float | None) -> np.ndarray | None:
    return None if length_rad is None else np.array([[0.0, 0.0], [length_rad, 0.0]])


def attempts(planner: str, lengths_rad: list[float | None], ms: list[float], collides: int = -1) -> list[Attempt]:
    """One attempt of each kind at each question; the path of question ``collides`` collides."""
    return [
        Attempt(planner, kind, k, line(length), time_ms, None if length is None else k == collides)
        for k, (length, time_ms) in enumerate(zip(lengths_rad, ms, strict=True))
        for kind in KINDS
    ]


def test_failures_count_at_the_limit_and_what_nobody_solves_is_left_out() -> None:
    ours = attempts(OURS, [2.0, None, 3.0, None], [1.0, 2.0, 3.0, 4.0])
    peer = attempts("peer", [4.0, 1.0, None, None], [10.0, 20.0, 900.0, 900.0], collides=1)
    figures = figures_of([*ours, *peer], LIMIT_MS)
    assert (figures["n_questions"], figures["n_solvable"]) == (4, 3)
    mine, theirs = (figures["planners"][name]["raw"] for name in (OURS, "peer"))
    assert (mine["n_solved"], theirs["n_solved"], mine["solved_share"]) == (2, 2, 0.6667)
    assert (mine["time_ms"]["p50"], mine["time_ms"]["worst"]) == (3.0, LIMIT_MS)
    assert (mine["solved_time_ms"]["worst"], theirs["solved_time_ms"]["worst"]) == (3.0, 20.0)
    assert (theirs["length_to_ours"], theirs["n_compared"]) == ({"median": 2.0, "p95": 2.0}, 1), "only where both have a path"
    assert theirs["ours_to_length"] == {"median": 0.5, "p95": 0.5}
    assert theirs["times_ours"]["p50"] == pytest.approx(20.0 / 3.0, abs=0.01)
    assert (mine["collisions"], theirs["collisions"]) == (0, 1)


def test_a_better_peer_is_said_to_be_better_and_a_worse_one_is_not() -> None:
    ours = attempts(OURS, [2.0, 2.0, None], [5.0, 5.0, 5.0], collides=0)
    better = attempts("peer", [1.0, 1.0, 1.0], [1.0, 1.0, 1.0])
    said = better_than_ours(figures_of([*ours, *better], LIMIT_MS))
    for words in (
        "solves more (3 against 2 of 3)",
        "faster at p50 (1 against 5 ms)",
        "shorter paths (median 0.500",
        "fewer paths that collide",
    ):
        assert any(line.startswith("peer, raw") and words in line for line in said), words
    worse = attempts("peer", [3.0, None, None], [9.0, 9.0, 9.0], collides=0)
    assert better_than_ours(figures_of([*ours, *worse], LIMIT_MS)) == []


def test_where_nobody_solves_anything_there_are_no_figures_and_no_error() -> None:
    figures = figures_of([*attempts(OURS, [None], [1.0]), *attempts("peer", [None], [1.0])], LIMIT_MS)
    assert figures["n_solvable"] == 0 and figures["planners"]["peer"]["raw"]["time_ms"] is None
    assert better_than_ours(figures) == []


def test_a_missing_wheel_names_the_extra_before_anything_is_made(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "benchmarks.peers.roboplan_peer", None)
    assert main(["bench", "peers", "--n", "1", "--peers", "roboplan_rrt_connect"]) == 1
    told = capsys.readouterr().err
    assert "peer_missing" in told and "[bench]" in told


@pytest.mark.parametrize(
    ("words", "code"), [(["--peers", "rrt"], "unknown_peer"), (["--n", "0"], "out_of_range"), (["--limit-s", "0"], "out_of_range")]
)
def test_wrong_arguments_are_clear_errors(words: list[str], code: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "peers", *words]) == 1
    assert code in capsys.readouterr().err
