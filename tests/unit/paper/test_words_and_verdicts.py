"""Verdicts follow from numbers: turned round, they turn round."""

from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.paper.ask import Answer, Variant
from benchmarks.paper.claims.big_obstacles import EDGES_M, Fall
from benchmarks.paper.claims.big_obstacles import _verdict as verdict_on_obstacles
from benchmarks.paper.claims.big_obstacles_drawing import failed_share
from benchmarks.paper.claims.extension import Learned, verdict_on
from benchmarks.paper.claims.pairs import Pair, holds_of, together
from benchmarks.paper.claims.smoothing_cost import _costliest
from benchmarks.paper.claims.solved_share import Solved
from benchmarks.paper.claims.solved_share import verdict_on as verdict_on_share
from benchmarks.paper.outcome import HOLDS, IN_PART, NOT, UNDECIDED
from benchmarks.paper.shared_runs import Run
from benchmarks.paper.stats import mean_sigma, paired, share
from benchmarks.paper.table1 import verdict_on_collisions
from benchmarks.paper.table2 import PeerRun, verdict_on_time
from benchmarks.questions import Question

LONG = tuple(float(v) for v in np.linspace(4.0, 6.0, 20))
SHORT = tuple(0.8 * v for v in LONG)


def test_shorter_paths_hold_and_longer_ones_do_not() -> None:
    assert holds_of(Pair("", SHORT, LONG)) == HOLDS
    assert holds_of(Pair("", LONG, SHORT)) == NOT
    assert holds_of(Pair("", LONG, LONG)) == UNDECIDED
    assert holds_of(Pair("", (), ())) == UNDECIDED


def test_few_scenes_decide_nothing() -> None:
    assert holds_of(Pair("", SHORT[:3], LONG[:3])) == UNDECIDED


def test_several_comparisons_become_one_word() -> None:
    assert together([HOLDS, HOLDS]) == HOLDS
    assert together([HOLDS, NOT]) == IN_PART
    assert together([HOLDS, UNDECIDED]) == IN_PART
    assert together([NOT, UNDECIDED]) == NOT
    assert together([UNDECIDED]) == UNDECIDED


def falls(gamma_som_fails_at_m: float, gng_fails_at_m: float, n: int = 12) -> list[Fall]:
    edges = {"gamma_som": gamma_som_fails_at_m, "gng": gng_fails_at_m}
    last = EDGES_M[-1]
    return [
        Fall(scene, "paper", model, min(edge_m, last), 0.5, "no_path" if math.isfinite(edge_m) else "")
        for scene in range(n)
        for model, edge_m in edges.items()
    ]


def test_who_fails_at_the_smaller_cube_fails_more_often() -> None:
    assert verdict_on_obstacles(falls(0.12, 0.4), "paper").holds == HOLDS
    assert verdict_on_obstacles(falls(0.12, math.inf), "paper").holds == HOLDS
    assert verdict_on_obstacles(falls(0.4, 0.12), "paper").holds == NOT
    assert verdict_on_obstacles(falls(0.2, 0.2), "paper").holds == UNDECIDED


def test_scenes_that_end_without_a_failure_do_not_count_as_one() -> None:
    assert failed_share([Fall(0, "paper", "gng", EDGES_M[3], 0.1, "")])[-1] == 0.0
    assert failed_share([Fall(0, "paper", "gng", EDGES_M[3], 0.1, "no_path")])[2:4] == [0.0, 1.0]


def test_smoothing_is_costliest_only_if_no_other_step_takes_longer() -> None:
    stages = {"update": [1.0], "search": [2.0], "smooth": [1.5], "verify": [1.0], "time": [9.0]}
    assert _costliest(stages) is True
    assert _costliest({**stages, "search": [3.0]}) is False
    assert _costliest({stage: [] for stage in stages}) is None


def run_of(rules: str, collides: bool | None) -> Run:
    solved = collides is not None
    empty = np.empty((0, 6))
    got = Answer(solved, "solved" if solved else "no_path", np.empty(0, dtype=np.int32), empty, empty, 1.0, False, {})
    variant = Variant("gng", "dijkstra", True, rules)  # type: ignore[arg-type]
    return Run(variant, Question(0, np.zeros(6), np.zeros(6), np.empty((0, 2, 3)), np.empty(0, dtype=np.int32)), got, collides)


def test_one_collision_is_enough_to_deny_that_paths_are_free() -> None:
    runs = [run_of("paper", False), run_of("paper", True), run_of("checked", False), run_of("checked", None)]
    assert verdict_on_collisions(runs, "paper").holds == NOT
    assert verdict_on_collisions(runs, "paper").ours.startswith("1 of 2")
    assert verdict_on_collisions(runs, "checked").holds == HOLDS
    assert verdict_on_collisions([run_of("paper", None)], "paper").holds == UNDECIDED


def test_the_tail_decides_whether_a_motion_is_there_in_time() -> None:
    def verdict(ms: list[float]) -> str:
        return verdict_on_time([PeerRun("gng-dijkstra-smoothed-checked", 0, 0, np.zeros((2, 6)), value) for value in ms]).holds

    assert verdict([5.0] * 99 + [500.0]) == HOLDS
    assert verdict([5.0] * 80 + [500.0] * 20) == IN_PART
    assert verdict([30.0] * 10) == NOT
    assert verdict([]) == UNDECIDED


def learned(name: str, training_s: float, n_old: int, n_new: int, n: int = 40) -> Learned:
    solved = [tuple(k < count for k in range(n)) for count in (n_old, n_new)]
    return Learned(name, 100, training_s, 0.3, 0.3, *solved)


def test_an_extension_must_be_faster_keep_the_old_and_gain_the_new() -> None:
    def verdict(training_s: float, n_old: int, n_new: int) -> str:
        base, scratch = learned("general only", 3.0, 30, 10), learned("from scratch, both", 6.0, 30, 30)
        return verdict_on([base, learned("extended by the task", training_s, n_old, n_new), scratch]).holds

    assert verdict(4.0, 30, 30) == HOLDS
    assert verdict(8.0, 30, 30) == IN_PART
    assert verdict(4.0, 5, 30) == IN_PART  # forgotten
    assert verdict(4.0, 30, 12) == IN_PART  # gained by chance
    assert verdict(8.0, 5, 10) == NOT


def test_a_map_solves_more_only_beyond_chance() -> None:
    def verdict(n_som: int, n_gamma_som: int, n_gng: int, n: int = 100) -> str:
        counts = {"som": n_som, "gamma_som": n_gamma_som, "gng": n_gng}
        found = [Solved("checked", model, tuple(k < count for k in range(n)), (1.0,) * n) for model, count in counts.items()]
        told = verdict_on_share(found, [True] * n, "checked")
        assert f"GNG {n_gng} of {n} questions" in told.ours
        return told.holds

    assert verdict(60, 70, 90) == HOLDS
    assert verdict(60, 89, 90) == UNDECIDED
    assert verdict(60, 98, 90) == NOT


def test_numbers_become_words() -> None:
    assert mean_sigma([1.0, 3.0]) == "2.00 ± 1.41"
    assert mean_sigma([]) == "–"
    assert share(5, 10).startswith("5 of 10 (19–81")
    assert share(0, 0) == "–"
    ratio, n_less, p = paired(SHORT, LONG)
    assert ratio == pytest.approx(0.8)
    assert n_less == 20
    assert p < 1e-3
