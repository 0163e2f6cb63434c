"""``tolman bench solve``: what is counted as what, the judge on true shapes, and the whole of it on a few problems with a tiny map."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.exact import ExactPlanner, TrueWorld
from benchmarks.referee import Referee, at_steps
from benchmarks.solve_figures import figures, table
from benchmarks.solving import Record
from clients.cli.main import main
from common.cell import SolidConfig, load
from common.robot.model import RobotModel, load_robot
from services.planner.config import PlannerConfig
from services.planner.offline.problem_cell import problem_cell
from services.planner.offline.problems import Problem, read_problems
from tests.support.repository import ROOT

SUBSET = ROOT / "tests" / "data" / "motion_bench_maker_ur5.json"
UR5 = ROOT / "deploy" / "config" / "ur5.toml"
SOLVED = Record("s", 1, "solved", "solved", "map", "found", 2.0, 6.0, 5.0, False, 100)
TINY = ["n_neurons=60", "n_samples=600", "motions_per_problem=1", "n_workers=1", "voxel_m=0.005"]


@pytest.fixture(scope="module")
def ur5() -> RobotModel:
    cell, config = load(UR5, "planner", PlannerConfig, ["planner.problems.voxel_m=0.005"])
    return load_robot(problem_cell(cell, config)[0].robot)


@pytest.fixture(scope="module")
def problems(ur5: RobotModel) -> list[Problem]:
    return read_problems(SUBSET, ur5.joint_names, ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))


def test_shares_are_of_what_can_be_solved() -> None:
    records = [
        SOLVED,
        replace(SOLVED, index=2, way="repair", map_says="cut", ms=20.0, length_rad=10.0),
        replace(SOLVED, index=3, way="fallback", map_says="goal_apart", ms=200.0, exact="unsolved", reference_rad=None),
        replace(SOLVED, index=4, way=None, map_says="cut", length_rad=None),  # solvable in cells, we did not
        replace(SOLVED, index=5, way=None, cells="goal_blocked", map_says="goal_blocked", length_rad=None),  # lost to cells
        replace(SOLVED, index=6, way=None, exact="start_blocked", cells="start_blocked", map_says="start_blocked", length_rad=None),
        replace(SOLVED, index=7, collides=True, exact="unsolved", reference_rad=None),  # ours touches: no proof that it can be solved
    ]
    got = figures(records)
    assert (got["n_total"], got["n_solvable_exact"], got["n_solvable_cells"]) == (7, 5, 5)
    assert got["solved_share"] == {"map": 0.4, "repair": 0.6, "all": 0.8}
    assert got["exact_share"] == 0.6 and got["collisions"] == 1
    assert got["length_ratio"] == 1.6  # median of 1.2 and 2
    assert [got["time_ms"][way]["n"] for way in ("map", "repair", "fallback")] == [2, 1, 1] and got["time_ms"]["repair"]["p50"] == 20.0
    assert got["lost_to_cells"] == {"goal_blocked": 1} and got["map_says"] == {"found": 2, "cut": 2, "goal_apart": 1}
    assert "0.40" in table({"s": got})


def test_of_nothing_there_are_no_shares() -> None:
    got = figures([replace(SOLVED, way=None, exact="unsolved", cells="unsolved", length_rad=None)])
    assert got["solved_share"] == {"map": None, "repair": None, "all": None} and got["exact_share"] is None and got["length_ratio"] is None
    assert "-" in table({"s": got})


def test_the_subset_is_read_and_its_ends_are_free_on_the_true_shapes(ur5: RobotModel, problems: list[Problem]) -> None:
    assert len(problems) == 14 and len({p.set_name for p in problems}) == 7
    for p in problems:
        world = TrueWorld(ur5, p.solids)
        assert world.is_free(p.q_start) and world.is_free(p.q_goal), p.name


def test_the_tool_reaches_what_the_scene_is_about(ur5: RobotModel, problems: list[Problem]) -> None:
    """A frame read the wrong way would put the can anywhere: it is within a hand's reach, ahead of the gripper's end or below it."""
    for p in problems:
        here = np.linalg.inv(ur5.tool_pose(p.q_goal))
        things = [(here @ [*s.position_m, 1.0])[:3] for s in p.solids if s.name.startswith(("Can", "Cube"))]
        nearest = min(things, key=lambda at: float(np.linalg.norm(at)))
        assert np.linalg.norm(nearest[:2]) < 0.08 and 0.0 < nearest[2] < 0.45, p.name


def test_the_true_world_agrees_with_the_referee(ur5: RobotModel, problems: list[Problem]) -> None:
    rng = np.random.default_rng(1)
    for p in problems[::5]:
        world, referee = TrueWorld(ur5, p.solids), Referee(ur5, list(p.solids))
        for q in rng.uniform(ur5.position_min_rad, ur5.position_max_rad, size=(60, 6)):
            assert world.is_free(q) != referee.collides(q[None], np.empty((0, 2, 3)))


def test_rrt_connect_on_true_shapes(ur5: RobotModel) -> None:
    tail = [-1.2, 1.4, -1.8, -1.5708, 0.0]
    post = SolidConfig(name="post", shape="cylinder", size_m=[0.05, 1.0], position_m=(0.5, 0.0, 0.3))
    problem = Problem("posts", 1, np.array([-0.9, *tail]), np.array([0.9, *tail]), (post,))
    planner = ExactPlanner(ur5)
    found = planner.solve(problem, 10.0)
    assert found.outcome == "solved" and found.path_rad is not None
    assert np.allclose(found.path_rad[0], problem.q_start) and np.allclose(found.path_rad[-1], problem.q_goal)
    assert not Referee(ur5, [post]).collides(at_steps(found.path_rad), np.empty((0, 2, 3)))
    assert planner.solve(replace(problem, q_goal=np.array([0.0, *tail])), 1.0).outcome == "goal_blocked"
    assert planner.solve(replace(problem, q_start=np.array([9.0, *tail])), 1.0).outcome == "start_blocked"  # beyond its limits


def test_folds_a_map_file_and_the_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    some = json.loads(SUBSET.read_text())
    some["problems"] = {name: some["problems"][name] for name in ("bookshelf_small", "box")}
    few, report, built = tmp_path / "few.json", tmp_path / "report.json", tmp_path / "map.tolman"
    few.write_text(json.dumps(some), encoding="utf-8")
    words = ["--robot=ur5", f"--problems={few}", *(f"--set=planner.problems.{one}" for one in TINY)]
    assert main(["build", *words, f"--out={built}"]) == 0 and built.stat().st_size > 10_000
    solve = ["bench", "solve", *words, "--limit=0.2", f"--json={report}", "--set=planner.fallback.iterations=50"]
    assert main([*solve, "--folds=2", "--fold=1", "--go-on"]) == 0  # there is nothing to go on with yet
    told = json.loads(report.read_text())
    assert told["maps"][0]["fold"] == 1 and told["maps"][0]["asked"] == 2 and told["maps"][0]["asked_and_trained_on"] == 0
    assert [(r["set_name"], r["index"]) for r in told["problems"]] == [("bookshelf_small", 2), ("box", 2)]
    wanted = {"n_total", "n_solvable_exact", "n_solvable_cells", "solved_share", "exact_share", "collisions", "length_ratio", "time_ms"}
    assert set(told["sets"]) == {"bookshelf_small", "box", "all"} and wanted <= set(told["sets"]["all"])
    assert told["sets"]["all"]["collisions"] == 0 and {"machine", "commit", "seed", "config"} <= set(told)
    assert main([*solve, "--folds=2", "--go-on"]) == 0  # the other fold, beside the one that is there
    assert [m["fold"] for m in json.loads(report.read_text())["maps"]] == [1, 0]
    assert json.loads(report.read_text())["sets"]["all"]["n_total"] == 4
    assert main([*solve, f"--map={built}"]) == 0
    assert json.loads(report.read_text())["maps"][0]["asked_and_trained_on"] == 4
    capsys.readouterr()
    assert main(["bench", "solve", *words, "--set=planner.problems.resolution_m=0.05", f"--map={built}"]) == 1
    assert "made for another grid" in capsys.readouterr().err
    assert main(["bench", "solve", *words, "--folds=1"]) == 1
