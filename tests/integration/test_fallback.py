"""The fallback's process: it answers, it dies, it hangs, and nobody waits for it or is left with it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from common.robot.payload import Payload
from services.planner.config import MarginsConfig
from services.planner.core.neuron_index import index_neurons
from services.planner.core.two_trees import Known
from services.planner.core.ways import SamplingAnswer, SamplingQuestion
from services.planner.core.world import cells_of
from services.planner.fallback import process as module
from services.planner.fallback.process import FallbackProcess
from services.planner.kernels.connect import Graph
from services.planner.offline.scene import Scene
from tests.support.cell import ur3_cell
from tests.support.eventually import eventually
from tests.support.repository import ROOT

pytestmark = pytest.mark.integration
READY_S, ANSWER_S = 240.0, 60.0
HERE, THERE = np.array([-0.9, -1.2, 1.3, -1.6, -1.57, 0.0]), np.array([0.9, -1.2, 1.3, -1.6, -1.57, 0.0])
NOWHERE = np.array([0.0, -1.2, 1.3, -1.6, -1.57, 0.0])
BOX = Payload((0.05, 0.05, 0.10), (0.0, 0.0, 0.05))
SEED = np.arange(1, 5, dtype=np.uint64)
NONE = np.empty(0, dtype=np.int32)
EASY = SamplingQuestion(HERE, THERE[None], NONE, SEED, 2_000, n_searches=2)
# From a pose that the check does not allow nothing grows: all samples are used up.
ENDLESS = SamplingQuestion(HERE, np.array([[0.0, 0.6, 0.3, 0.0, 0.0, 0.0]]), NONE, SEED, 10_000_000)


def _process() -> FallbackProcess:
    one = FallbackProcess(ur3_cell(), MarginsConfig())
    assert one.wait_ready(READY_S)
    return one


def _is_there(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_equal_questions_equal_answers_also_over_a_death_in_mid_question() -> None:
    one = _process()
    first = one.pid
    assert first is not None
    answers = [one.send(EASY).wait()]
    heard: list[SamplingAnswer] = []
    got = threading.Event()
    number = one.ask(ENDLESS, heard.append)
    one.ask(EASY, lambda answer: (heard.append(answer), got.set()))  # takes turns with the long one
    os.kill(first, signal.SIGKILL)
    began = time.monotonic()
    assert got.wait(READY_S), "the question was put again"
    assert one.pid != first and one.restarts == 1 and time.monotonic() - began < READY_S
    one.withdraw(number)
    answers += [heard[-1], one.send(EASY).wait()]
    assert all(answer.q_rad is not None for answer in answers)
    assert len({answer.q_rad.tobytes() for answer in answers}) == 1
    last = one.pid
    one.close()
    assert last is not None and not _is_there(last)


def test_every_second_search_knows_the_map() -> None:
    """Without a sample only a map that leads there can answer."""
    neurons, near = np.array([HERE + 0.05, THERE + 0.05]), np.array([1, 0], dtype=np.int32)
    far = np.full(2, np.linalg.norm(neurons[1] - neurons[0]))
    graph = Graph(neurons, np.arange(3), near, np.zeros(2, dtype=np.int32), far, index_neurons(neurons))
    known = Known(graph, np.zeros(2, dtype=np.int32), np.zeros(1, dtype=np.int32))
    one, bare = _process(), replace(EASY, max_iterations=0)
    asked = {
        "bare": bare,
        "alone": replace(bare, known=known, n_searches=1),
        "second": replace(bare, known=known),
        "blocked": replace(bare, known=known._replace(node_count=np.ones(2, dtype=np.int32))),
        "again": replace(bare, known=known),
    }
    answers = {name: one.send(question).wait().q_rad for name, question in asked.items()}
    one.close()
    assert [name for name, q_rad in answers.items() if q_rad is not None] == ["second", "again"]
    np.testing.assert_array_equal(answers["second"], answers["again"])


def test_it_reckons_with_what_the_gripper_holds() -> None:
    """A cell that the box would be dragged through half way, and the bare arm passes over."""
    scene, one = Scene.of(ur3_cell(), MarginsConfig()), _process()
    start = np.array([-0.2, *HERE[1:]])  # not over a bin, which the box would be in
    below = (scene.robot.tool_pose((start + THERE) / 2.0) @ [0.0, 0.0, 0.08, 1.0])[:3]
    away_m = np.linalg.norm(scene.grid.centres(np.arange(scene.grid.n_cells)) - below, axis=1)
    cell = np.array([np.argmin(away_m)], dtype=np.int32)
    answers = {payload: one.send(replace(EASY, q_start_rad=start, cells=cell), payload).wait().q_rad for payload in (None, BOX)}
    one.close()
    free, checker = {}, scene.holding(BOX).checker()
    for payload, q_rad in answers.items():
        assert q_rad is not None
        free[payload] = all(checker.segment(cells_of(scene.grid, cell), a, b) for a, b in pairwise(q_rad))
    assert free == {None: False, BOX: True}


def test_a_process_that_hangs_is_ended_and_the_question_answered(monkeypatch: pytest.MonkeyPatch) -> None:
    one = _process()
    monkeypatch.setattr(module, "SILENT_S", 1.0)
    assert one.pid is not None
    os.kill(one.pid, signal.SIGSTOP)
    began = time.monotonic()
    one.ask(EASY, lambda _answer: None)
    assert time.monotonic() - began < 0.1, "asking does not wait"
    answer = one.send(EASY).wait()  # in vain or from the next process: but it comes
    assert answer.q_rad is not None or answer.why
    assert one.restarts >= 1
    last = one.pid
    one.close()
    assert last is not None and eventually(lambda: not _is_there(last), 5.0)


def test_a_process_that_works_for_long_is_left_to_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """It says that it is alive; on a slow machine a question may take longer than a silence may last."""
    one = _process()
    monkeypatch.setattr(module, "SILENT_S", 3.0)
    pid, began = one.pid, time.monotonic()
    number = one.ask(ENDLESS, lambda _answer: None)
    assert eventually(lambda: one.restarts > 0 or time.monotonic() - began > 8.0, 10.0)
    assert one.restarts == 0 and one.pid == pid
    one.withdraw(number)
    assert one.send(EASY).wait().q_rad is not None
    one.close()


def test_closing_answers_what_is_pending() -> None:
    one = _process()
    heard: list[SamplingAnswer] = []
    one.ask(ENDLESS, heard.append)
    pid = one.pid
    one.close()
    assert [answer.q_rad for answer in heard] == [None]
    assert pid is not None and not _is_there(pid)


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGINT])
def test_it_is_gone_when_the_planner_is_however_that_ended(end: signal.Signals) -> None:
    """Also in the middle of a question."""
    script = (
        "import signal, sys\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # ignored where the tests run in the background
        "from tests.integration.test_fallback import ENDLESS, _process\n"
        "one = _process()\n"
        "one.ask(ENDLESS, print)\n"
        "print(one.pid, flush=True)\n"
        "sys.stdin.read()\n"
    )
    with subprocess.Popen([sys.executable, "-c", script], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as planner:
        assert planner.stdout is not None
        pid = int(planner.stdout.readline())
        assert _is_there(pid)
        planner.send_signal(end)
        planner.wait(10.0)
    assert eventually(lambda: not _is_there(pid), 5.0), "an orphan"
