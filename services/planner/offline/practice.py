"""Practice: the map is asked among things that it has not seen, and where it has no way, what repair finds becomes part of it.

A gas is dense where many motions went, but what a map lacks are the few neurons through a gap that boxes leave. Repair
(:mod:`services.planner.core.repair`) finds such a way in some milliseconds and uses the map up to the gap, so a lesson costs a handful of
neurons. Measured on 500 questions of ``task`` (other boxes and ends than those practised on, 459 of them solvable), always 10 000 neurons:
a gas alone solves 430; with 687 neurons from 103 lessons of 3 000 exercises 441; with as many put where motions are worst represented 432.
Whole ways, corners cut, instead of what lies beside the map: four times the neurons for the same.

What a lesson adds may be an island: joint limits leave pockets of free space that nothing joins with the rest, and a map that begins as one
component knows none of them. Measured: with the UR3's shoulder turned right over a way goes from pick to place, in 3 of 1 230 motions and 7
of 500 questions of ``task``; with islands the map alone solves 1 350 of 1 500 such questions, without 1 341.

Deterministic: exercises and generators are drawn from numbers, and the map that is asked grows only between rounds.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from queue import SimpleQueue

import msgspec
import numpy as np
from numpy.typing import NDArray

from common.errors import RequestError
from services.planner.config import PlannerConfig
from services.planner.core.cognitive_map import CognitiveMap, n_components
from services.planner.core.find import PathFinder
from services.planner.core.found import NO_NEURON, FoundPath
from services.planner.core.growth import Addition, Ground, grown
from services.planner.core.layer_table import NO_LAYERS
from services.planner.core.learning import LearningRules, learn
from services.planner.core.lookup import N_THREADS, BlockedCounts, LookupTable
from services.planner.core.roadmap import Roadmap
from services.planner.core.route import Route
from services.planner.core.two_trees import Bounds, Joined, Known, TwoTrees, seed_of
from services.planner.core.world import World, no_cells
from services.planner.kernels.connect import NO_WAY
from services.planner.offline.exercises import Exercise, Exercises
from services.planner.offline.finishing import layer_rules
from services.planner.offline.pruning import fill_up
from services.planner.offline.scene import Scene

__all__ = ["Practised", "before_practice", "n_to_practise", "practise", "rehearse"]

F64 = NDArray[np.float64]
FIRST_ROUND, ROUNDS = 50, 8  # our choice: a round is twice the last one, up to an eighth of all; small maps are soon full
REHEARSED_RAD = 0.5  # of every joint; our choice


def n_to_practise(config: PlannerConfig) -> int:
    """Neurons of a map that are left to practice; none of a lattice, which keeps to its lattice."""
    return round(config.practice.share * config.map.n_neurons) if config.model == "gng" else 0


def before_practice(config: PlannerConfig) -> PlannerConfig:
    """The config of the map that practice begins with: smaller by what is left to it."""
    n_neurons = config.map.n_neurons - n_to_practise(config)
    return msgspec.structs.replace(config, map=msgspec.structs.replace(config.map, n_neurons=n_neurons))


@dataclass(frozen=True, eq=False)
class Practised:
    """The map and its table; ``n_exercises`` asked, ``n_unanswered`` of them by the map, ``n_lessons`` taken in, with ``n_neurons``.

    ``n_islands``: components that the map has more than before.
    """

    learned: CognitiveMap
    table: LookupTable
    n_exercises: int
    n_unanswered: int
    n_lessons: int
    n_neurons: int
    n_islands: int


def practise(
    scene: Scene,
    config: PlannerConfig,
    roadmap: Roadmap,
    new_exercises: Callable[[], Exercises],
    samples_rad: F64,
    progress: Callable[[float], None] = lambda _share: None,
) -> Practised:
    """``roadmap`` grown to ``config.map.n_neurons`` by practice; what practice leaves is filled up from the samples.

    Args:
        scene: arm, grid and static layer of the map.
        config: ``[planner.practice]``, ``[planner.map]``, and for the rows of the table margins and clearance.
        roadmap: the map; its neurons and edges keep their numbers.
        new_exercises: makes what gives the exercises, once for each thread.
        samples_rad: (S, J) training samples, from which missing neurons are taken.
        progress: called with the share done.
    """
    wanted, most = n_to_practise(config), round(config.practice.exercises_per_neuron * config.map.n_neurons)
    pupil = _Pupil(scene, config, roadmap)
    desks: SimpleQueue[_Desk] = SimpleQueue()
    for _ in range(N_THREADS):
        desks.put(_Desk(scene, config, new_exercises()))
    n_done, size = 0, FIRST_ROUND
    with ThreadPoolExecutor(N_THREADS) as pool:
        while n_done < most and pupil.room > 0:
            numbers = range(n_done, min(n_done + size, most))
            pupil.take_in(list(pool.map(partial(_at_a_desk, desks, pupil.roadmap, pupil.room), numbers)))
            n_done, size = numbers.stop, max(FIRST_ROUND, min(2 * size, most // ROUNDS))
            progress(max(n_done / most, 1.0 - pupil.room / max(1, wanted)))
    n_neurons = pupil.roadmap.n_neurons - roadmap.n_neurons
    pupil.fill(samples_rad)
    whole = pupil.grown_whole(roadmap)
    learned = CognitiveMap(whole.neurons_rad, whole.edges)
    n_islands = n_components(learned) - n_components(CognitiveMap(roadmap.neurons_rad, roadmap.edges))
    return Practised(learned, whole.table, n_done, pupil.n_unanswered, pupil.n_lessons, n_neurons, n_islands)


def rehearse(scene: Scene, config: PlannerConfig, roadmap: Roadmap) -> None:
    """Go once through what practice calls, so that it is compiled; nothing is kept."""
    home = scene.robot.home_rad
    exercise = Exercise(home, home + REHEARSED_RAD, np.empty(0, dtype=np.int32))
    desk = _Desk(scene, config, lambda _number: exercise)
    desk.lessons(roadmap, 1, 0)
    counts = roadmap.counts(scene.grid)
    counts.node[:] = 1  # a map of which nothing is free: both trees begin with their ends alone
    desk.repaired(roadmap, World.of(scene.grid, counts), exercise)
    middle = Addition(roadmap.neurons_rad.mean(axis=0)[None], np.array([[0, roadmap.n_neurons]], dtype=np.int32))
    _Pupil(scene, config, roadmap).take_in([[middle]])


def _at_a_desk(desks: SimpleQueue[_Desk], roadmap: Roadmap, room: int, number: int) -> list[Addition] | None:
    desk = desks.get()
    try:
        return desk.lessons(roadmap, room, number)
    finally:
        desks.put(desk)


class _Desk:
    """Where the map is asked; one for each thread."""

    def __init__(self, scene: Scene, config: PlannerConfig, exercises: Exercises) -> None:
        self._scene, self._config, self._exercises = scene, config, exercises
        self._checker, self._nothing = scene.checker(), no_cells(scene.grid)
        self._asked: tuple[Roadmap, PathFinder, BlockedCounts] | None = None

    def lessons(self, roadmap: Roadmap, room: int, number: int) -> list[Addition] | None:
        """What exercise ``number`` teaches the map, in at most ``room`` neurons; None if there is nothing to learn from it."""
        exercise = self._exercises(number)
        if exercise is None:
            return None
        if self._asked is None or self._asked[0] is not roadmap:
            self._asked = (roadmap, PathFinder(roadmap, self._checker), roadmap.counts(self._scene.grid))
        _, finder, counts = self._asked
        counts.set_cells(exercise.cells)
        world = World.of(self._scene.grid, counts)
        route, status, _, _ = Route.ask(finder, world, exercise.q_start, exercise.q_goal, "dijkstra")
        if status != NO_WAY or isinstance(route.find(), FoundPath):
            return None
        joined = self.repaired(roadmap, world, exercise)
        stretches = [] if joined is None else _beside_the_map(roadmap, joined)
        return [addition for stretch in stretches if (addition := self._learned(roadmap, room, stretch)) is not None]

    def repaired(self, roadmap: Roadmap, world: World, exercise: Exercise) -> Joined | None:
        """A way of an exercise through and beside the map."""
        robot, goals, counts = self._scene.robot, exercise.q_goal[None], world.counts
        joint_range = (robot.position_min_rad, robot.position_max_rad)
        state = seed_of(counts.cells, exercise.q_start, goals)
        known = Known(roadmap.graph, counts.node, counts.edge)
        bounds = Bounds(self._config.practice.iterations, connections=self._config.repair.connections)
        search = TwoTrees(self._checker, world.cells, known, exercise.q_start, goals, joint_range, state, bounds)
        while not search.advance():
            pass
        return search.found()

    def _learned(self, roadmap: Roadmap, room: int, stretch_rad: F64) -> Addition | None:
        """What a stretch (P, J) adds to the map; None if nothing. It may be an island: an arm that is there already needs no way out."""
        m = self._config.map
        rules = LearningRules(self._config.practice.step_rad, 0.0, m.join_neighbours, m.bridge_max_rad, room, exactly=True)
        try:
            addition = learn(roadmap, stretch_rad, rules, lambda a, b: self._checker.segment(self._nothing, a, b))
        except RequestError:  # longer than there is room, or, looked at closely, not free
            return None
        return None if addition.is_empty else addition


class _Pupil:
    """The map that grows; without layers, since no exercise asks how near things are."""

    def __init__(self, scene: Scene, config: PlannerConfig, roadmap: Roadmap) -> None:
        self.roadmap = replace(roadmap, table=replace(roadmap.table, layers=NO_LAYERS))
        self.n_unanswered, self.n_lessons = 0, 0
        self._config = config
        self._checker, self._nothing = scene.checker(), no_cells(scene.grid)
        rules = layer_rules(scene.arm, scene.grid, config)
        self._ground = Ground(scene.arm, scene.grid, scene.margins.safety_m, scene.margins.edge_step_m, rules)

    @property
    def room(self) -> int:
        """Neurons that are wanted still."""
        return self._config.map.n_neurons - self.roadmap.n_neurons

    def take_in(self, answers: list[list[Addition] | None]) -> None:
        """All that there is room for; each lesson was made on the same map, so that its numbers are shifted here."""
        n, n_added = self.roadmap.n_neurons, 0
        neurons, edges = [np.empty((0, self.roadmap.neurons_rad.shape[1]))], [np.empty((0, 2), dtype=np.int32)]
        self.n_unanswered += sum(answer is not None for answer in answers)
        for lesson in [lesson for answer in answers for lesson in answer or []]:
            if n_added + len(lesson.neurons_rad) <= self.room:
                neurons.append(lesson.neurons_rad)
                edges.append(np.where(lesson.edges >= n, lesson.edges + n_added, lesson.edges).astype(np.int32))
                n_added += len(lesson.neurons_rad)
                self.n_lessons += 1
        self._grow(Addition(np.vstack(neurons), np.unique(np.vstack(edges), axis=0)))

    def fill(self, samples_rad: F64) -> None:
        """Neurons where the samples are worst represented, until none is wanted."""
        n, m = self.roadmap.n_neurons, self._config.map
        so_far = CognitiveMap(self.roadmap.neurons_rad, self.roadmap.edges)
        whole = fill_up(so_far, samples_rad, m.n_neurons, lambda a, b: self._checker.segment(self._nothing, a, b), m.join_neighbours)
        self._grow(Addition(whole.q_rad[n:], whole.edges[(whole.edges >= n).any(axis=1)]))

    def grown_whole(self, before: Roadmap) -> Roadmap:
        """``before``, with its layers, grown by all that was taken in."""
        now, n, m = self.roadmap, before.n_neurons, before.n_edges
        return grown(before, Addition(now.neurons_rad[n:], now.edges[m:]), self._ground, n_threads=N_THREADS)

    def _grow(self, addition: Addition) -> None:
        self.roadmap = grown(self.roadmap, addition, replace(self._ground, layers=None), n_threads=N_THREADS)


def _beside_the_map(roadmap: Roadmap, joined: Joined) -> list[F64]:
    """The stretches (P >= 2, J) of a way that are no edges of the map, without ends that join it straight."""
    names = [NO_NEURON, *joined.neurons.tolist(), NO_NEURON]
    last = len(names) - 1
    stretches: list[list[F64]] = []
    goes_on = False
    for k, (a, b) in enumerate(pairwise(names)):
        joins_straight = (k == 0 and b != NO_NEURON) or (k + 1 == last and a != NO_NEURON)
        beside = not joins_straight and not _has_edge(roadmap, a, b)
        if beside:
            stretches = stretches if goes_on else [*stretches, [joined.q_rad[k]]]
            stretches[-1].append(joined.q_rad[k + 1])
        goes_on = beside
    return [np.array(stretch) for stretch in stretches]


def _has_edge(roadmap: Roadmap, a: int, b: int) -> bool:
    if NO_NEURON in (a, b):
        return False
    return b in roadmap.adj_node[roadmap.adj_offset[a] : roadmap.adj_offset[a + 1]]
