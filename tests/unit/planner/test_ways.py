"""What follows where the map has no way, and what an arm that stands makes of cells that change meanwhile."""

from __future__ import annotations

import itertools
import re
import time

import numpy as np
import pytest

from services.planner.core.cognitive_map import CognitiveMap
from services.planner.core.find import PathFinder
from services.planner.core.found import NotFound
from services.planner.core.lookup import BlockedCounts, build_table
from services.planner.core.motion import Ask, Motion, MotionPlanner, Stopwatch
from services.planner.core.roadmap import Roadmap
from services.planner.core.thinker import RESTARTS, Thinker
from services.planner.core.timing import Limits
from services.planner.core.two_trees import Bounds, TwoTrees, no_map
from services.planner.core.ways import HEAD_START, SamplingAnswer, SamplingQuestion, Thinking, ThinkingRules, think
from services.planner.core.world import World
from services.planner.offline.regions import box_cells

RANGE = (np.full(6, -np.pi), np.full(6, np.pi))
HERE = np.array([-0.9, -1.2, 1.3, -1.6, -1.57, 0.0])
THERE = np.array([0.9, -1.2, 1.3, -1.6, -1.57, 0.0])
NO_WAY = NotFound("no_path", "the map has none")
ALL = ThinkingRules(("map", "repair", "fallback"), Bounds(3_000, 50, 6_000, 8), 3_000)
NOT_IN_REPAIR = ThinkingRules(("map", "fallback"), Bounds(3_000, 50, 6_000, 8), 3_000)


class Answered:
    """An errand that is done."""

    def __init__(self, answer: SamplingAnswer) -> None:
        self.answer, self.is_withdrawn = answer, False

    def wait(self) -> SamplingAnswer:
        return self.answer

    def withdraw(self) -> None:
        self.is_withdrawn = True


class Scene:
    """A map of two neurons, one at either end, that know of one another only by a straight way, and a wall across it."""

    def __init__(self, bench) -> None:
        self.bench = bench
        learned = CognitiveMap(np.array([HERE + 0.05, THERE + 0.05]), np.array([[0, 1]], dtype=np.int32))
        table = build_table(bench.checker.arm, bench.grid, learned.q_rad, learned.edges, safety_m=0.02, step_m=0.02)
        self.roadmap = Roadmap.of(learned, table, "gng")
        limits = Limits(np.full(6, 2.0), np.full(6, 5.0))
        from services.planner.core.check import HandReach

        hand = HandReach(0.25, 0.15, np.full(6, 5.0))
        self.planner = MotionPlanner(PathFinder(self.roadmap, bench.checker), limits, hand, RANGE, shortcut_checks=10)
        self.counts = BlockedCounts(table, 2, 1)
        self.wall = self.box([0.25, -0.04, 0.0], [0.55, 0.04, 0.35])

    def box(self, low, high):
        return box_cells(self.bench.grid, np.array(low), np.array(high)).astype(np.int32)

    def world(self, *cells) -> World:
        self.counts.set_cells(np.unique(np.concatenate(cells)) if cells else np.empty(0, dtype=np.int32))
        return World.of(self.bench.grid, self.counts)

    def keeps_clear(self, world: World, motion: Motion) -> bool:
        """What the check, sample by sample, says of a curve that was proven by its pieces: between samples it may touch by half a step."""
        checker = self.bench.checker
        return checker.curve_meets(world.cells, motion.curve, safety_m=checker.safety_m - checker.step_m / 2) is None

    def send(self, question: SamplingQuestion) -> Answered:
        return Answered(self.sample(question))

    def sample(self, question: SamplingQuestion) -> SamplingAnswer:
        """The fallback, here."""
        from services.planner.core.world import cells_of

        cells = cells_of(self.bench.grid, question.cells)
        bounds = Bounds(question.max_iterations)
        ends = (question.q_start_rad, question.q_goals_rad)
        search = TwoTrees(self.bench.checker, cells, no_map(6), *ends, RANGE, question.seed.copy(), bounds)
        while not search.advance():
            pass
        found = search.found()
        return SamplingAnswer(None if found is None else found.q_rad, "none", search.iterations, 1.0)


@pytest.fixture(scope="module")
def scene(bench) -> Scene:
    return Scene(bench)


def _watch() -> Stopwatch:
    return Stopwatch(time.perf_counter_ns)


def _ask(q=HERE) -> Ask:
    return Ask(q, q)


def test_the_map_alone_has_no_way_and_repair_has(scene):
    world = scene.world(scene.wall)
    assert isinstance(scene.planner.answer(world, Ask(HERE, THERE), _watch()), NotFound)
    motion = think(Thinking(scene.planner, world, _ask(), THERE[None], ALL, "why"), world, _watch(), scene.send)
    assert isinstance(motion, Motion)
    assert motion.path.way == "repair"
    np.testing.assert_allclose(motion.curve.q_rad[[0, -1]], [HERE, THERE], rtol=0.0, atol=1e-12)
    assert scene.keeps_clear(world, motion)


def test_the_fallback_answers_where_repair_is_not_wanted(scene):
    world = scene.world(scene.wall)
    thinking = Thinking(scene.planner, world, _ask(), THERE[None], NOT_IN_REPAIR, "why")
    watch, slices = _watch(), 0
    while not thinking.is_waiting:
        assert thinking.advance(world, watch) is None
        slices += 1
    assert slices < 10
    assert thinking.advance(world, watch) is None, "it waits and does not block"
    motion = None
    while motion is None and thinking.wanted is not None:  # a curve along the first way need not be free: then another is asked for
        thinking.hear(scene.sample(thinking.wanted))
        motion = thinking.advance(world, watch)
    assert isinstance(motion, Motion) and motion.path.way == "fallback"
    assert scene.keeps_clear(world, motion)


@pytest.mark.parametrize("rules", [ALL, NOT_IN_REPAIR])
def test_equal_questions_get_equal_answers(scene, rules):
    answers = []
    for _ in range(2):
        world = scene.world(scene.wall)
        motion = think(Thinking(scene.planner, world, _ask(), THERE[None], rules, "why"), world, _watch(), scene.send)
        assert isinstance(motion, Motion)
        answers.append(motion.curve.q_rad.tobytes() + motion.path.q_rad.tobytes())
    assert answers[0] == answers[1]


def test_a_goal_among_cells_or_a_start_among_them_is_not_thought_about(scene):
    goal_box = scene.box(*(scene.bench.robot.tool_pose(THERE)[:3, 3] + np.array([[-0.03], [0.03]])))
    world = scene.world(scene.wall, goal_box)
    for start, goal in ((HERE, THERE), (THERE, HERE)):
        outcome = Thinking(scene.planner, world, _ask(start), goal[None], ALL, "why").advance(world, _watch())
        assert outcome == NotFound("no_path", "why")


def test_no_way_says_what_was_tried(scene):
    few = ThinkingRules(("map", "repair", "fallback"), Bounds(5, 5, 6_000, 8), 5)
    shell = _shell_around(scene, HERE)
    world = scene.world(shell)
    outcome = think(Thinking(scene.planner, world, _ask(), THERE[None], few, "why"), world, _watch(), scene.send)
    assert isinstance(outcome, NotFound)
    assert outcome.reason.startswith("why; repair found no way in 5 samples")


def test_the_second_search_of_repair_ends_where_the_fallback_is_asked(scene):
    world = scene.world(_shell_around(scene, HERE))
    samples = {}
    for ways in (("map", "repair"), ("map", "repair", "fallback")):
        rules = ThinkingRules(ways, Bounds(3_000, 50, 6_000, 8), 5, repair_searches=2)
        outcome = think(Thinking(scene.planner, world, _ask(), THERE[None], rules, "why"), world, _watch(), scene.send)
        samples[ways] = int(re.search(r"repair found no way in (\d+) samples", outcome.reason)[1])
    alone, beside = samples.values()
    assert alone == 6_000 and 3_000 + HEAD_START / 2 - 200 <= beside <= 3_000 + HEAD_START / 2 + 50


def _shell_around(scene, q):
    """Cells all round the tool, just outside its safety distance."""
    centre = scene.bench.robot.tool_pose(q)[:3, 3]
    outer = scene.box(centre - 0.16, centre + 0.16)
    free = [cell for cell in outer if not scene.bench.checker.cells_hit(scene.world(np.array([cell], dtype=np.int32)).cells, q).any()]
    return np.array(free, dtype=np.int32)


# --- an arm that stands ---


def _thinker(scene, rules=ALL) -> Thinker:
    return Thinker(scene.planner, rules, scene.bench.grid)


def _think_on(thinker, world, limit=400):
    watch = _watch()
    for _ in range(limit):
        outcome = thinker.advance(world, watch)
        if outcome is not None or not thinker.wants_steps:
            return outcome
    raise AssertionError("it does not end")


def test_it_thinks_until_there_is_a_motion(scene):
    world, thinker = scene.world(scene.wall), _thinker(scene)
    assert thinker.consider("g", THERE[None], _ask(), world, NO_WAY) == NO_WAY
    assert thinker.is_thinking and thinker.wants_steps
    assert isinstance(_think_on(thinker, world), Motion)


def test_a_patch_of_cells_lets_it_begin_anew_and_single_ones_do_not(scene):
    far = scene.box([-0.7, -0.7, 0.6], [-0.66, -0.66, 0.64])
    assert len(far) >= 8
    thinker = _thinker(scene)
    thinker.consider("g", THERE[None], _ask(), scene.world(scene.wall), NO_WAY)
    first = thinker._thinking
    thinker.consider("g", THERE[None], _ask(), scene.world(scene.wall, far[:1]), NO_WAY)
    assert thinker._thinking is first
    begun = [first]
    for k in range(RESTARTS + 3):
        thinker.consider("g", THERE[None], _ask(), scene.world(scene.wall, *([far] if k % 2 == 0 else [])), NO_WAY)
        begun.append(thinker._thinking)
    assert len({id(one) for one in begun}) == RESTARTS + 1, "a hand that waves does not keep it from ever ending"


def test_what_was_thought_through_in_vain_is_not_thought_again_until_something_changes(scene):
    few = ThinkingRules(("map", "repair"), Bounds(5, 5, 6_000, 8), 5)
    shell, thinker = _shell_around(scene, HERE), _thinker(scene, few)
    world = scene.world(shell)
    thinker.consider("g", THERE[None], _ask(), world, NO_WAY)
    outcome = _think_on(thinker, world)
    assert isinstance(outcome, NotFound)
    assert thinker.consider("g", THERE[None], _ask(), world, NO_WAY) == outcome and not thinker.is_thinking
    thinker.consider("g", THERE[None], _ask(), scene.world(scene.wall), NO_WAY)
    assert thinker.is_thinking
    thinker.drop()
    assert not thinker.is_thinking


def test_a_way_that_came_to_be_blocked_while_it_was_sought_is_not_taken(scene):
    world, thinker = scene.world(scene.wall), _thinker(scene)
    thinker.consider("g", THERE[None], _ask(), world, NO_WAY)
    motion = _think_on(thinker, world)
    assert isinstance(motion, Motion)
    middle = motion.curve.sample(motion.curve.duration_s / 2)[0]
    centre = scene.bench.robot.tool_pose(middle)[:3, 3]
    in_the_way = scene.box(centre - 0.04, centre + 0.04)
    thinker = _thinker(scene)
    thinker.consider("g", THERE[None], _ask(), scene.world(scene.wall), NO_WAY)
    other = scene.world(scene.wall, in_the_way)
    later = _think_on(thinker, other)
    if isinstance(later, Motion):
        assert scene.keeps_clear(other, later)


def test_an_answer_to_a_question_of_before_is_of_no_use(scene):
    world, thinker = scene.world(scene.wall), _thinker(scene, NOT_IN_REPAIR)
    thinker.consider("g", THERE[None], _ask(), world, NO_WAY)
    assert _think_on(thinker, world) is None
    old = thinker.question
    assert old is not None
    answer = scene.sample(old)
    thinker.consider("another", THERE[None], _ask(), world, NO_WAY)
    thinker.hear(old, answer)
    assert _think_on(thinker, world) is None and thinker.question is not None and thinker.question is not old
    thinker.hear(thinker.question, scene.sample(thinker.question))
    motion = _think_on(thinker, world)
    assert isinstance(motion, Motion)
    assert all(scene.bench.checker.segment(world.cells, a, b) for a, b in itertools.pairwise(motion.path.q_rad))
