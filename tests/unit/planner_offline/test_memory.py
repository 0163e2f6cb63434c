"""A planner that learns, forgets nothing between starts, and starts all the same when its journal is no good."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import msgspec
import numpy as np
import pytest

from common.clock import monotonic_ns
from common.errors import ArtefactError, RequestError, TolmanError
from services.planner.assemble import Parts
from services.planner.config import PlannerConfig
from services.planner.core.lookup import cells_of_pose
from services.planner.core.roadmap import Roadmap
from services.planner.learner import Lesson, Student
from services.planner.memory import Memory, journal_of, recall
from services.planner.offline import build
from services.planner.offline.build import Job
from services.planner.rehearsal import rehearse_learning
from tests.support.cell import ur3_cell
from tests.unit.planner.test_growth import assert_equal

PATH = np.linspace([0.0, -1.5708, 1.5708, -1.5708, -1.5708, 0.0], [-2.2, -1.4, 1.1, -1.4, -1.2, -1.0], 40)
BACK = PATH[::-1] + np.array([0.0, 0.1, 0.0, 0.0, 0.0, 0.8])


@pytest.fixture(scope="module")
def built(small: PlannerConfig, tmp_path_factory: pytest.TempPathFactory) -> build.Built:
    return build.run(Job.of(ur3_cell(), small, cache=tmp_path_factory.mktemp("memory")))[0]


@pytest.fixture
def parts(small: PlannerConfig, built: build.Built, scene) -> Parts:
    for journal in built.path.parent.glob("learned-*.jsonl"):
        journal.unlink()
    return Parts(ur3_cell(), small, scene.robot, scene.grid, Roadmap.of(built.learned, built.table, "gng"), built)


def changed(parts: Parts, **learning: object) -> Parts:
    config = msgspec.structs.replace(parts.config, learning=msgspec.structs.replace(parts.config.learning, **learning))
    return Parts(parts.cell, config, parts.robot, parts.grid, parts.roadmap, parts.built)


def student(parts: Parts, memory: Memory | None = None) -> Student:
    return Student(memory or recall(parts), parts.reflex(monotonic_ns, "test"))


def test_what_was_learned_is_there_at_the_next_start_bit_for_bit(parts: Parts) -> None:
    one = student(parts)
    first, second = one.take_in(Lesson(PATH, label="wave")), one.take_in(Lesson(BACK))
    assert first.reply.added_neurons > 0 and second.reply.n_neurons == second.parts.roadmap.n_neurons
    assert second.reply.n_neurons == 150 + first.reply.added_neurons + second.reply.added_neurons
    assert (first.reply.number, second.reply.number, second.facts["n_neurons"]) == (1, 2, second.reply.n_neurons)
    again = recall(parts)
    assert again.complaint == "" and again.journal is not None and [e.label for e in again.journal.entries] == ["wave", ""]
    assert_equal(again.parts.roadmap, second.parts.roadmap)
    third = student(parts, again).take_in(Lesson(PATH))
    assert third.reply.added_neurons == 0 and third.finder is None, "what is known adds nothing"


def test_a_way_is_learned_among_the_cells_it_was_found_in(parts: Parts) -> None:
    grid, margins = parts.grid, parts.config.margins
    on_the_way = cells_of_pose(parts.checker().arm, grid, PATH[20], safety_m=margins.safety_m)
    far = np.array([0, 1, 2], dtype=np.int32)
    forgetful = changed(parts, keep=False)
    n_alone, n_far, n_near = (
        student(forgetful).take_in(Lesson(PATH, source="repair", cells=cells)).reply.added_neurons for cells in (None, far, on_the_way)
    )
    assert 0 < n_alone == n_far < n_near


def test_the_live_planner_takes_a_grown_map_and_counts_its_cells(parts: Parts) -> None:
    reflex = parts.reflex(monotonic_ns, "test")
    one = Student(recall(parts), reflex)
    learned = one.take_in(Lesson(PATH))
    row = learned.parts.roadmap.table
    cells = np.flatnonzero(np.diff(row.node_offset))[::50].astype(np.int32)
    cells = np.union1d(cells, parts.roadmap.table.unavoidable).astype(np.int32)
    reflex.see(0.0, 0.0, cells, 1, 0)  # a frame that came while the map was prepared
    live = reflex.vision.counts.cells
    learned.adopt(reflex)
    counts = reflex.vision.counts
    assert len(counts.node) == learned.reply.n_neurons and len(counts.edge) == learned.reply.n_edges

    def assert_counted(occupied: np.ndarray) -> None:
        for count, owners_of in ((counts.node, row.neurons_of), (counts.edge, row.edges_of)):
            expected = np.bincount(np.concatenate([owners_of(c) for c in occupied]), minlength=len(count))
            np.testing.assert_array_equal(count, expected)

    assert_counted(live)
    spared = np.setdiff1d(parts.roadmap.table.unavoidable, row.unavoidable)
    assert reflex.vision.see(0.1, cells) == bool(np.isin(spared, cells).any()), "what can be avoided from now on appears with a frame"
    assert_counted(np.setdiff1d(cells, row.unavoidable))
    assert reflex.planner.finder.roadmap is learned.parts.roadmap and reflex.vision.world.counts is counts


def test_a_rehearsal_keeps_nothing(parts: Parts) -> None:
    one = student(parts)
    rehearse_learning(one, parts)
    one.take_in(Lesson(PATH), rehearsal=True)
    assert journal_of(parts).entries == () and one.take_in(Lesson(PATH)).reply.number == 1


def test_without_keep_nothing_is_written_and_nothing_read(parts: Parts) -> None:
    student(parts).take_in(Lesson(PATH))
    forgetful = changed(parts, keep=False)
    memory = recall(forgetful)
    assert memory.journal is None and memory.complaint == "" and memory.parts.roadmap is parts.roadmap
    before = journal_of(parts).head
    assert student(forgetful).take_in(Lesson(PATH)).reply.added_neurons > 0
    assert journal_of(parts).head == before


@pytest.mark.parametrize("damage", ["torn", "foreign"])
def test_a_bad_journal_is_left_out_by_name_and_not_written_to(parts: Parts, damage: str) -> None:
    student(parts).take_in(Lesson(PATH))
    path = journal_of(parts).path
    whole = path.read_bytes()
    path.write_bytes(whole[:-30] if damage == "torn" else whole.replace(parts.built.sha256.encode(), b"0" * 64))
    damaged = path.read_bytes()
    memory = recall(parts)
    assert path.name in memory.complaint and memory.journal is None and memory.parts.roadmap is parts.roadmap
    with pytest.raises(RequestError) as caught:
        student(parts, memory).take_in(Lesson(PATH))
    assert caught.value.code == "bad_journal" and path.name in caught.value.message
    assert path.read_bytes() == damaged


def test_after_a_revert_a_running_planner_learns_no_more(parts: Parts) -> None:
    one = student(parts)
    one.take_in(Lesson(PATH))
    journal_of(parts).reverted(0)
    with pytest.raises(ArtefactError) as caught:
        one.take_in(Lesson(BACK))
    assert caught.value.code == "journal_changed"
    assert recall(parts).parts.roadmap.n_neurons == 150


def test_growth_is_bounded_over_all_lessons(parts: Parts) -> None:
    n = student(changed(parts, keep=False)).take_in(Lesson(PATH)).reply.added_neurons
    one = student(changed(parts, max_added_neurons=n))
    one.take_in(Lesson(PATH))
    with pytest.raises(RequestError) as caught:
        one.take_in(Lesson(BACK))
    assert caught.value.code == "map_full" and f"max_added_neurons = {n}" in caught.value.message
    with pytest.raises(RequestError) as caught:
        student(changed(parts, max_added_neurons=n - 1, keep=False)).take_in(Lesson(PATH))
    assert caught.value.code == "too_long"


@pytest.mark.parametrize("model", ["som", "gamma_som"])
def test_a_lattice_learns_nothing_and_says_why(parts: Parts, model: str) -> None:
    student(parts).take_in(Lesson(PATH))  # a gas' journal is no lattice's
    lattice = parts.on(dataclasses.replace(parts.roadmap, model=model))
    memory = recall(lattice)
    assert memory.journal is None and memory.complaint == "" and memory.parts is lattice
    one = student(lattice, memory)
    rehearse_learning(one, lattice)
    with pytest.raises(RequestError, match=f"a {model} has a fixed grid, .* cannot be extended") as caught:
        one.take_in(Lesson(PATH))
    assert caught.value.code == "cannot_extend" and caught.value.facts == {"model": model}


@pytest.mark.parametrize(
    ("lesson", "code", "words"),
    [
        (Lesson(PATH, np.arange(39.0)), "bad_shape", "[40]"),
        (Lesson(PATH, np.arange(40.0)[::-1]), "bad_times", "t_s[1]: 38.0"),
        (Lesson(PATH, np.where(np.arange(40) == 7, np.nan, np.arange(40.0))), "bad_times", "t_s[7]: nan"),
        (Lesson(PATH, label="x" * 201), "too_long", "201"),
        (Lesson(np.repeat(PATH, 600, axis=0)), "too_long", "24000"),
        (Lesson(PATH[:, :5]), "bad_shape", "[40, 5]"),
        (Lesson(np.zeros(())), "bad_shape", "[1]"),
        (Lesson(np.full((40, 6), np.nan)), "out_of_limits", "q_rad[0]"),
    ],
)
def test_bad_lessons_are_refused_and_leave_nothing(parts: Parts, lesson: Lesson, code: str, words: str) -> None:
    with pytest.raises(TolmanError) as caught:
        student(parts).take_in(lesson)
    assert caught.value.code == code and words in caught.value.message
    assert journal_of(parts).entries == () and not Path(journal_of(parts).path).exists()
