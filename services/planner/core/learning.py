"""Learning one motion: from a joint path to what joins the map. Pure; it only ever adds.

The path is walked at the map's own spacing. Where a neuron is near enough and the ways to it, from the one before and on to the next point
are free, that neuron is used; else the point becomes a new one. Each new neuron is also joined with its nearest neighbours by
free edges: the insertion rule of :mod:`services.planner.offline.pruning`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from common.errors import RequestError
from common.robot.model import RobotModel
from services.planner.core.check import Checker
from services.planner.core.cognitive_map import CognitiveMap
from services.planner.core.growth import Addition
from services.planner.core.roadmap import Roadmap
from services.planner.kernels.cells import Cells
from services.planner.kernels.collision import FREE
from services.planner.kernels.path import segment_verdict

__all__ = ["LearningRules", "MotionCheck", "check_path", "learn", "usual_spacing"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
MotionCheck = Callable[[F64, F64], bool]  # from, to (J,): free?
SAME_PLACE_RAD = 1e-9  # two samples nearer than this are one: a recorded arm rests
HALVINGS = 5  # a bend that a step would cut is walked in steps down to 1/32 of the spacing; our choice
BRIDGE_ATTEMPTS = 50  # pairs of neurons that are tried to join a path that lies apart, as in offline.pruning


@dataclass(frozen=True)
class LearningRules:
    """How a path is taken in.

    Attributes:
        spacing_rad: step along the path.
        reuse_rad: a neuron so near to a point of the path stands for it.
        join_neighbours: nearest neurons that a new one is joined with.
        join_max_rad: longest edge.
        max_neurons: how many may be added.
        exactly: the path itself, corner by corner, no neuron nearby standing for a point of it: for a path among cells, through
            which there may be no other. It may be an island: an arm that is there already needs no way from the rest of the map.
    """

    spacing_rad: float
    reuse_rad: float
    join_neighbours: int
    join_max_rad: float
    max_neurons: int
    exactly: bool = False


def usual_spacing(learned: CognitiveMap) -> float:
    """Median length in rad of a map's edges; infinite of a map without edges: one step a path."""
    return float(np.median(learned.edge_length_rad)) if len(learned.edges) else np.inf


def check_path(q_rad: F64, robot: RobotModel, checker: Checker, empty: Cells) -> F64:
    """The path (P >= 2, J) without repetitions, proven possible at all: live cells do not matter, they come and go.

    Raises:
        RequestError: wrong shape, a value that is not finite or leaves its limits, a sample or the straight way between two that meets
            the static layer or the arm itself, no motion at all; names the sample and what is wrong.
    """
    q = np.ascontiguousarray(q_rad, dtype=np.float64)
    if q.ndim != 2 or q.shape[1] != robot.n_joints or len(q) < 2:
        raise RequestError(f"q_rad: expected a path (K >= 2, {robot.n_joints}), got shape {list(q.shape)}", code="bad_shape")
    possible = np.isfinite(q) & (q >= robot.position_min_rad) & (q <= robot.position_max_rad)
    if not possible.all():
        k = int(np.argmin(possible.all(axis=1)))
        raise RequestError(f"q_rad[{k}]: {robot.limit_violation(q[k])}", code="out_of_limits", facts={"index": k})
    moves = np.linalg.norm(np.diff(q, axis=0), axis=1) > SAME_PLACE_RAD
    index = np.concatenate([[0], 1 + np.flatnonzero(moves)])
    if len(index) < 2:
        raise RequestError(f"q_rad: all {len(q)} samples are the same place", code="no_motion")
    for a, b in pairwise(index):
        args = (checker.arm, checker.solids, empty, checker.safety_m, checker.step_m, q[a], q[b])
        verdict, what, share = segment_verdict(*args)
        if verdict != FREE:
            raise _in_the_way(int(a), int(b), share, checker.describe(int(verdict), int(what)))
    return np.asarray(q[index])


def _in_the_way(a: int, b: int, share: float, what: str) -> RequestError:
    if share in (0.0, 1.0):
        k = a if share == 0.0 else b
        return RequestError(f"q_rad[{k}]: {what}", code="in_collision", facts={"index": k})
    return RequestError(
        f"q_rad: {share:.2f} of the way from sample {a} to {b}: {what}", code="in_collision", facts={"index": a, "share": float(share)}
    )


def learn(
    roadmap: Roadmap, path_rad: F64, rules: LearningRules, motion_is_free: MotionCheck, among_cells: MotionCheck | None = None
) -> Addition:
    """What a path (P >= 2, J), free along its straight pieces, adds to a map.

    Args:
        roadmap: the map.
        path_rad: the path.
        rules: how it is taken in.
        motion_is_free: whether a straight motion is free where nothing is seen; every new edge is.
        among_cells: the same among the cells that the path was found in. Through a narrow place the path is walked in steps so small that
            each is free among them too, looked at where the table looks at an edge: else the map would know the way and not take it.

    Raises:
        RequestError: it needs more neurons than allowed, cannot be followed by straight steps, or cannot be joined to the map.
    """
    way = _Way.of(path_rad)
    growing = _Growing(roadmap, rules, motion_is_free, among_cells or motion_is_free)
    marks = way.marks_at_corners(rules.spacing_rad) if rules.exactly else way.marks(rules.spacing_rad)
    chain: list[int] = []
    for k, mark in enumerate(marks):
        ahead = way.at(marks[k + 1]) if k + 1 < len(marks) else None
        before = chain[-1] if chain else None
        known = growing.standing_for(way.at(mark), before, ahead)
        if known is not None:
            chain.append(known)
        elif before is None:
            chain.append(growing.add(way.at(mark)))
        else:
            chain += growing.step(way, before, float(marks[k - 1]), float(mark), HALVINGS)
    growing.join_neighbours()
    if not rules.exactly:
        growing.join_to_map(chain)
    return growing.addition()


@dataclass(frozen=True, eq=False)
class _Way:
    """A polyline by the distance along it."""

    along_rad: F64
    q_rad: F64

    @staticmethod
    def of(q_rad: F64) -> _Way:
        return _Way(np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(q_rad, axis=0), axis=1))]), q_rad)

    @property
    def length_rad(self) -> float:
        return float(self.along_rad[-1])

    def marks(self, spacing_rad: float) -> F64:
        """Equal steps of at most ``spacing_rad`` along all of it."""
        return np.linspace(0.0, self.length_rad, max(2, int(np.ceil(self.length_rad / spacing_rad)) + 1))

    def marks_at_corners(self, spacing_rad: float) -> F64:
        """Equal steps of at most ``spacing_rad`` along each of its pieces."""
        marks = [np.zeros(1)]
        for a, b in pairwise(self.along_rad):
            marks.append(np.linspace(a, b, max(1, int(np.ceil((b - a) / spacing_rad))) + 1)[1:])
        return np.concatenate(marks)

    def at(self, mark_rad: float) -> F64:
        return np.array([np.interp(mark_rad, self.along_rad, self.q_rad[:, j]) for j in range(self.q_rad.shape[1])])


class _Growing:
    """The map with what was added so far. Every edge that it takes was found free."""

    def __init__(self, roadmap: Roadmap, rules: LearningRules, motion_is_free: MotionCheck, along_the_way: MotionCheck) -> None:
        self._roadmap, self._rules, self._is_free, self._is_free_along = roadmap, rules, motion_is_free, along_the_way
        self._n = roadmap.n_neurons
        self._q = np.empty((self._n + rules.max_neurons, roadmap.neurons_rad.shape[1]))
        self._q[: self._n] = roadmap.neurons_rad
        self._edges: dict[tuple[int, int], None] = {}

    def addition(self) -> Addition:
        edges = np.array(list(self._edges), dtype=np.int32).reshape(-1, 2)
        return Addition(self._q[self._roadmap.n_neurons : self._n].copy(), edges)

    def add(self, q: F64) -> int:
        if self._n == len(self._q):
            raise RequestError(f"q_rad: the path needs more than {self._rules.max_neurons} new neurons", code="too_long")
        self._q[self._n] = q
        self._n += 1
        return self._n - 1

    def standing_for(self, q: F64, before: int | None, ahead: F64 | None) -> int | None:
        """The nearest neuron if it may stand for the point ``q`` of the path; joined with the one before."""
        near = int(np.argmin(np.linalg.norm(self._q[: self._n] - q, axis=1)))
        at = self._q[near]
        if np.linalg.norm(at - q) > (SAME_PLACE_RAD if self._rules.exactly else self._rules.reuse_rad) or not self._is_free(at, q):
            return None
        if ahead is not None and not self._is_free(at, ahead):
            return None
        if before is None or before == near:
            return near
        return near if self._is_free_along(self._q[before], at) and self._join(before, near) else None

    def step(self, way: _Way, before: int, from_rad: float, to_rad: float, halvings: int) -> list[int]:
        """New neurons along the way up to ``to_rad``: one if the straight step is free, else in halves.

        Of the smallest steps no more is asked than of any edge: the cells among which the way was found may be gone already.
        """
        q = way.at(to_rad)
        is_free = self._is_free_along if halvings > 0 else self._is_free
        if is_free(self._q[before], q):
            new = self.add(q)
            self._edges[(before, new)] = None
            return [new]
        if halvings == 0:
            facts = {"from_q_rad": self._q[before].tolist(), "to_q_rad": q.tolist()}
            raise RequestError(
                f"q_rad: {to_rad:.3f} rad along the path no straight step of {to_rad - from_rad:.3f} rad is free",
                code="in_collision",
                facts=facts,
            )
        middle = 0.5 * (from_rad + to_rad)
        first = self.step(way, before, from_rad, middle, halvings - 1)
        return first + self.step(way, first[-1], middle, to_rad, halvings - 1)

    def join_neighbours(self) -> None:
        """Free edges from each new neuron to its nearest ones."""
        for new in range(self._roadmap.n_neurons, self._n):
            distance = np.linalg.norm(self._q[: self._n] - self._q[new], axis=1)
            distance[new] = np.inf
            k = min(self._rules.join_neighbours, self._n - 1)
            for other in np.argsort(distance, kind="stable")[:k]:
                if distance[other] <= self._rules.join_max_rad:
                    self._join(int(other), new)

    def join_to_map(self, chain: list[int]) -> None:
        """Make sure that the path is no island.

        Raises:
            RequestError: no free edge leads to the map.
        """
        n = self._roadmap.n_neurons
        if n == 0 or any(k < n for k in chain) or any(a < n <= b for a, b in self._edges):
            return
        block = np.array([np.linalg.norm(self._q[:n] - self._q[k], axis=1) for k in chain])
        nearest = np.argmin(block, axis=1)
        distance = block[np.arange(len(chain)), nearest]
        for i in np.argsort(distance, kind="stable")[:BRIDGE_ATTEMPTS]:
            if distance[i] <= self._rules.join_max_rad and self._join(int(nearest[i]), chain[i]):
                return
        raise RequestError(
            f"q_rad: no free edge of at most {self._rules.join_max_rad:g} rad leads to the map; its nearest neuron is "
            f"{distance.min():.3f} rad away",
            code="not_joined",
            facts={"distance_rad": float(distance.min())},
        )

    def _join(self, a: int, b: int) -> bool:
        """Whether there is an edge or a free one could be made."""
        pair = (min(a, b), max(a, b))
        if pair in self._edges or self._has_edge(*pair):
            return True
        if not self._is_free(self._q[a], self._q[b]):
            return False
        self._edges[pair] = None
        return True

    def _has_edge(self, a: int, b: int) -> bool:
        r = self._roadmap
        return b < r.n_neurons and bool(np.any(r.adj_node[r.adj_offset[a] : r.adj_offset[a + 1]] == b))
