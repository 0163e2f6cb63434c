"""Out of cells that came too near, and on from there: straight to a neuron where that leads out, else by a short step to free ground."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from services.planner.core.check import Checker
from services.planner.core.find import PathFinder
from services.planner.core.found import NO_NEURON, FoundPath, NotFound
from services.planner.core.route import Route
from services.planner.core.world import Leaving, World
from services.planner.kernels.collision import FREE
from services.planner.kernels.connect import GOAL_BLOCKED, START_BLOCKED

__all__ = ["WayOut", "route_of", "steps_out"]

F64 = NDArray[np.float64]

STEPS_RAD = (0.1, 0.2, 0.4, 0.7)  # lengths of a step out, short ones first; our choice
N_DIRECTIONS = 60  # drawn ones besides the joints' own, the same each time; our choice
MAX_STEPS = 6  # steps from which a path is sought; our choice


def steps_out(checker: Checker, world: World, leaving: Leaving, q_start: F64, q_min: F64, q_max: F64) -> Iterator[F64]:
    """Poses (J,) near ``q_start`` that are free of all cells, each reached by a straight way that only moves away from those tolerated.

    The shortest steps come first; equal questions get equal steps.
    """
    n_joints = len(q_start)
    drawn = np.random.default_rng(0).normal(size=(N_DIRECTIONS, n_joints))
    directions = np.vstack([np.eye(n_joints), -np.eye(n_joints), drawn / np.linalg.norm(drawn, axis=1, keepdims=True)])
    for step_rad, direction in itertools.product(STEPS_RAD, directions):
        q = q_start + step_rad * direction
        inside = bool(np.all((q >= q_min) & (q <= q_max)))
        free = inside and checker.pose(world.cells, q)[0] == FREE and checker.segment(leaving.rest.cells, q_start, q)
        if free and leaving.is_way_out(checker, q_start, q):
            yield q


class WayOut:
    """A question whose start stands among cells that it may leave; asked and banned like a :class:`Route`."""

    def __init__(
        self, finder: PathFinder, world: World, leaving: Leaving, q_start: F64, q_goal: F64, search: str, joint_range: tuple[F64, F64]
    ) -> None:
        self._finder, self._world, self._leaving = finder, world, leaving
        self._q_start, self._q_goal, self._search = q_start, q_goal, search
        self._straight = Route(finder, leaving.rest, leaving, q_start, q_goal, search)
        self._steps = itertools.islice(steps_out(finder.checker, world, leaving, q_start, *joint_range), MAX_STEPS)
        self._on: tuple[F64, Route] | None = None  # the step taken now, and the question from there
        self._found_on: FoundPath | None = None

    def find(self) -> FoundPath | NotFound:
        """The best path of those not banned."""
        if self._on is None:
            found = self._straight.find()
            if isinstance(found, FoundPath) or not self._take_next_step():
                return found
        while self._on is not None:
            step, route = self._on
            found = route.find()
            if isinstance(found, FoundPath):
                self._found_on = found
                neurons = np.concatenate([[NO_NEURON], found.neurons]).astype(np.int32)
                q_rad = np.vstack([self._q_start, step, found.q_rad[1:]])
                return FoundPath(neurons, q_rad, self._leaving)
            if not self._take_next_step():
                break
        return NotFound("no_path", self._finder.no_way(self._world))

    def ban(self, found: FoundPath, piece: int) -> None:
        """Never again use the straight piece from ``found.q_rad[piece]`` to the next point."""
        if self._on is None or self._found_on is None:
            self._straight.ban(found, piece)
        elif piece <= 0:
            self._take_next_step()
        else:
            self._on[1].ban(self._found_on, piece - 1)

    def _take_next_step(self) -> bool:
        step = next(self._steps, None)
        self._on = None if step is None else (step, Route(self._finder, self._world, None, step, self._q_goal, self._search))
        return self._on is not None


def route_of(
    finder: PathFinder, world: World, q_start: F64, q_goal: F64, search: str, joint_range: tuple[F64, F64]
) -> Route | WayOut | NotFound:
    """A question by checked rules, to be asked once or, with parts of the answer banned, again.

    Args:
        finder: the map.
        world: the occupied cells and what they block.
        q_start, q_goal: (J,) rad.
        search: one of :data:`services.planner.core.find.SEARCHES`.
        joint_range: (J,) least and (J,) largest joint angles.
    """
    checker = finder.checker
    route, status, verdict, index = Route.ask(finder, world, q_start, q_goal, search)
    if status == GOAL_BLOCKED:
        return NotFound("goal_blocked", f"goal: {checker.describe(verdict, index)}")
    if status != START_BLOCKED:
        return route
    leaving = world.leaving(checker, q_start)
    if leaving is None:
        return NotFound("start_blocked", f"start: {checker.describe(verdict, index)}")
    verdict, index = checker.pose(leaving.rest.cells, q_goal)
    if verdict != FREE:
        return NotFound("goal_blocked", f"goal: {checker.describe(verdict, index)}")
    return WayOut(finder, world, leaving, q_start, q_goal, search, joint_range)
