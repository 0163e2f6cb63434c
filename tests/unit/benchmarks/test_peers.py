"""Peers answer as a planner must: free paths, none where there is none, in their time; the referee agrees."""

from __future__ import annotations

import time

import numpy as np
import pytest

from benchmarks.peers.peer import Peer, Setting, path_length_rad
from benchmarks.peers.registry import PEERS, make_peer
from benchmarks.questions import Question
from benchmarks.referee import Referee
from common.errors import RequestError
from services.planner.config import MarginsConfig
from services.planner.core.world import cells_of
from services.planner.offline.regions import box_cells
from services.planner.offline.scene import Scene
from tests.support.cell import ur3, ur3_cell

LEFT = np.array([0.9, -1.3, 1.4, -1.7, -1.57, 0.0])  # tool down, over the place bin
RIGHT = np.array([-0.9, -1.3, 1.4, -1.7, -1.57, 0.0])  # over the pick bin
ROOM_M = 0.03  # of the holes in the shelf: a little more than the safety distance


@pytest.fixture(scope="module")
def setting() -> Setting:
    return Setting.of(ur3_cell(), MarginsConfig())


@pytest.fixture(scope="module")
def referee() -> Referee:
    return Referee(ur3(), ur3_cell().static)


@pytest.fixture(scope="module", params=PEERS)
def peer(request: pytest.FixtureRequest, setting: Setting) -> Peer:
    made = make_peer(request.param, setting)
    made.prepare()
    return made


def asked(setting: Setting, *boxes: tuple[list[float], list[float]], q_goal: np.ndarray = RIGHT) -> Question:
    corners = np.array(boxes, dtype=np.float64).reshape(-1, 2, 3)
    cells = [box_cells(setting.grid, low, high) for low, high in corners]
    return Question(0, LEFT, q_goal, corners, np.unique(np.concatenate([np.empty(0, dtype=np.int32), *cells])).astype(np.int32))


def post(setting: Setting) -> Question:
    """A post in the way between the bins."""
    return asked(setting, ([0.25, -0.06, 0.0], [0.45, 0.06, 0.4]))


def shelf(setting: Setting) -> Question:
    """A shelf across all that the arm reaches, with snug holes where start and goal pass through it: no way from one to the other.

    It lies at the middle of the upper arm, whose ends are thicker than the holes.
    """
    goal = LEFT - [np.pi, 0.0, 0.0, 0.0, 0.0, 0.0]
    checker = Scene.of(ur3_cell(), setting.margins).checker()
    cells = box_cells(setting.grid, np.array([-0.8, -0.8, 0.24]), np.array([0.8, 0.8, 0.28]))
    for q in (LEFT, goal):
        world = cells_of(setting.grid, cells)  # which orders them
        cells = world.flat[~checker.cells_hit(world, q, safety_m=ROOM_M)]
    return Question(0, LEFT, goal, np.empty((0, 2, 3)), cells)


def test_an_easy_question_is_solved_free_and_the_simplified_path_is_no_longer(peer: Peer, setting: Setting, referee: Referee) -> None:
    question = post(setting)
    assert referee.path_collides(np.array([LEFT, RIGHT]), setting.grid, question.cells)
    answer = peer.solve(question, 5.0, seed=1)
    assert answer.path_rad is not None and answer.raw_rad is not None and answer.reason == ""
    for path in (answer.raw_rad, answer.path_rad):
        np.testing.assert_array_equal(path[[0, -1]], [LEFT, RIGHT])
        assert np.all((path >= ur3().position_min_rad) & (path <= ur3().position_max_rad))
        assert not referee.path_collides(path, setting.grid, question.cells, question.boxes_m)
    assert path_length_rad(answer.path_rad) <= path_length_rad(answer.raw_rad) + 1e-9
    steps = [answer.seconds[step] for step in ("world", "plan", "simplify")]
    assert all(seconds > 0.0 for seconds in steps)
    assert sum(steps) == pytest.approx(answer.seconds["total"])


def test_without_simplifying_the_raw_path_is_the_answer(peer: Peer, setting: Setting) -> None:
    answer = peer.solve(post(setting), 5.0, seed=1, simplify=False)
    assert answer.path_rad is not None
    np.testing.assert_array_equal(answer.path_rad, answer.raw_rad)
    assert answer.seconds["simplify"] == 0.0


def test_where_there_is_no_way_there_is_none_within_the_limit(peer: Peer, setting: Setting) -> None:
    question = shelf(setting)
    began = time.monotonic()
    answer = peer.solve(question, 0.5)
    assert answer.path_rad is None and answer.raw_rad is None and answer.reason
    assert answer.seconds["plan"] > 0.4
    assert time.monotonic() - began < 20.0  # coarse: the machine may be busy


def test_a_goal_that_is_not_free_is_said_at_once(peer: Peer, setting: Setting) -> None:
    tool = ur3().tool_pose(RIGHT)[:3, 3]
    answer = peer.solve(asked(setting, (list(tool - 0.05), list(tool + 0.05))), 60.0)
    assert answer.path_rad is None
    assert "goal" in answer.reason.lower()
    assert answer.seconds["total"] < 30.0, "it does not search until its limit"


def test_nothing_of_one_question_is_left_for_the_next(peer: Peer, setting: Setting) -> None:
    assert peer.solve(shelf(setting), 0.1, simplify=False).path_rad is None
    empty = peer.solve(asked(setting), 5.0, simplify=False)
    assert empty.path_rad is not None


@pytest.mark.parametrize("name", [name for name in PEERS if name != "ompl_prm"])  # which grows by wall-clock time
def test_equal_seeds_give_equal_paths(name: str, setting: Setting) -> None:
    question = post(setting)
    limit_s = 60.0  # generous: a busy machine must not let it cut in
    paths = [make_peer(name, setting).solve(question, limit_s, seed, simplify=False).path_rad for seed in (3, 3, 4)]
    assert all(path is not None for path in paths)
    np.testing.assert_array_equal(paths[0], paths[1])
    assert not np.array_equal(paths[0], paths[2])


def test_a_wrong_name_is_a_clear_error(setting: Setting) -> None:
    with pytest.raises(RequestError, match="no peer is called 'rrtconnect'; there are: ompl_rrt_connect, ") as caught:
        make_peer("rrtconnect", setting)
    assert caught.value.code == "unknown_peer"


def test_a_missing_library_is_a_clear_error(setting: Setting, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "benchmarks.peers.roboplan_peer", None)
    with pytest.raises(RequestError, match=r"it comes with the extra \[bench\]") as caught:
        make_peer("roboplan_rrt_connect", setting)
    assert caught.value.code == "peer_missing"
