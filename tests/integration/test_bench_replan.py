"""``tolman bench replan`` from end to end, on few questions and a small map."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.answers import Answerer
from benchmarks.equal_answers import are_equal_elsewhere
from benchmarks.paper.scale import QUICK
from benchmarks.questions import questions
from clients.cli.main import main
from common.cell import load
from services.planner.assemble import assemble
from services.planner.config import PlannerConfig
from services.planner.core.motion import Motion

N = 4
NO_FALLBACK = "planner.ways=['map','repair']"


@pytest.mark.batch
def test_figures_of_few_questions(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    small = [f"--override={value}" for value in QUICK.overrides]
    assert main(["bench", "replan", "--n", str(N), "--json", str(tmp_path / "r.json"), *small]) == 0
    told = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    assert {"machine", "commit", "seed", "config", "set", "n"} <= set(told) and told["n"] == N
    assert 1 <= told["all_ways"]["n_solved"] <= told["n_solvable"] <= N
    assert told["n_solved"] == told["all_ways"]["map"]["n_solved"] <= told["all_ways"]["n_solved"]
    assert told["collisions"] == 0 and told["equal_answers_in_3_processes"] is True
    assert told["connect_search_ms"]["p50"] < told["answer_ms"]["p50"] <= told["refined_ms"]["p50"]
    assert json.loads(capsys.readouterr().out)["n_solvable"] == told["n_solvable"]


@pytest.mark.batch
def test_no_questions_are_refused_by_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "replan", "--n", "0"]) == 1
    assert "--n 0" in capsys.readouterr().err


@pytest.mark.batch
def test_an_answer_that_differs_in_one_bit_is_noticed() -> None:
    overrides = [*QUICK.overrides, NO_FALLBACK]
    parts = assemble(*load(None, "planner", PlannerConfig, overrides))
    asked = list(questions(parts, "task", N, 0))
    answerer = Answerer(parts, None)
    answers = [answerer.answer(question) for question in asked]
    assert are_equal_elsewhere(None, overrides, asked, answers)
    motion = next(answer.motion for answer in answers if isinstance(answer.motion, Motion))
    motion.path.q_rad[0, 0] = np.nextafter(motion.path.q_rad[0, 0], np.inf)
    assert not are_equal_elsewhere(None, overrides, asked, answers)
