"""The one generator of questions behind every figure: named sets, one question from one seed.

* ``task``: unseen inverse-kinematics poses of the pick and the place region; 1 to 3 random boxes of 200 to 1 000 cells of 2 cm in all (as
  much space in cells of another size), which leave start and goal free and block the straight joint line between them.
* ``off_task``: start and goal uniform in joint space and free; boxes as for ``task``.
* ``wall``: as ``task``, but the boxes block more than half of the map's neurons.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.errors import RequestError
from services.planner.assemble import Parts
from services.planner.core.inverse_kinematics import InverseKinematics
from services.planner.core.world import cells_of, no_cells
from services.planner.kernels.collision import FREE
from services.planner.offline.regions import box_cells, random_box, tool_pose_in

__all__ = ["SETS", "Question", "questions"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]

SETS = ("task", "off_task", "wall")
CELLS_MIN, CELLS_MAX, CELL_M = 200, 1000, 0.02  # issue
BOXES_MAX = 3  # issue
BOX_MIN_M, BOX_MAX_M = 0.06, 0.25  # our choice: from a hand to a crate, as in the motions
WALL_MIN_M, WALL_MAX_M = 0.1, 0.6  # our choice: big enough to block half of the neurons
SPREAD_M = 0.08  # our choice: of a box's centre about the way of the tool
DRAWS = 2000  # of ends and boxes until a question fits its set


@dataclass(frozen=True, eq=False)
class Question:
    """Start and goal (J,) rad, boxes (n, 2, 3) lowest and highest corners in metres, and the cells they touch (C,)."""

    index: int
    q_start: F64
    q_goal: F64
    boxes_m: F64
    cells: I32


def questions(parts: Parts, name: str, n: int, seed: int) -> Iterator[Question]:
    """The first ``n`` questions of a set.

    Raises:
        RequestError: no such set, or the cell gives no such question (its regions cannot be reached).
    """
    if name not in SETS:
        raise RequestError(f"--set {name}: one of {', '.join(SETS)}", code="unknown_set")
    drawer = _Drawer(parts, name)
    for index in range(n):
        yield drawer.draw(index, np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(SETS.index(name), index))))


class _Drawer:
    def __init__(self, parts: Parts, name: str) -> None:
        self._parts = parts
        self._name = name
        self._checker = parts.checker()
        self._inverse = InverseKinematics(parts.robot)
        self._counts = parts.roadmap.counts(parts.grid)

    def draw(self, index: int, rng: np.random.Generator) -> Question:
        for _ in range(DRAWS):
            ends = self._uniform_ends(rng) if self._name == "off_task" else self._task_ends(rng)
            if ends is None:
                continue
            boxes = self._boxes(*ends, rng)
            cells = self._cells(boxes)
            if self._fits(*ends, cells):
                return Question(index, *ends, boxes, cells)
        raise RequestError(f"set {self._name}: no question {index} in {DRAWS} draws", code="no_question")

    def _task_ends(self, rng: np.random.Generator) -> tuple[F64, F64] | None:
        regions = [self._parts.config.motions.pick, self._parts.config.motions.place]
        if rng.random() < 0.5:
            regions.reverse()
        ends = []
        for region in regions:
            free = [q for q in self._inverse.solve(tool_pose_in(region, rng)) if self._is_free(q)]
            if not free:
                return None
            ends.append(np.array(free))
        start = ends[0][rng.integers(len(ends[0]))]
        return start, ends[1][np.argmin(np.linalg.norm(ends[1] - start, axis=1))]

    def _uniform_ends(self, rng: np.random.Generator) -> tuple[F64, F64] | None:
        low, high = self._parts.robot.position_min_rad, self._parts.robot.position_max_rad
        start, goal = rng.uniform(low, high), rng.uniform(low, high)
        return (start, goal) if self._is_free(start) and self._is_free(goal) else None

    def _is_free(self, q: F64) -> bool:
        return self._checker.pose(no_cells(self._parts.grid), q)[0] == FREE

    def _boxes(self, q_start: F64, q_goal: F64, rng: np.random.Generator) -> F64:
        sizes = (WALL_MIN_M, WALL_MAX_M) if self._name == "wall" else (BOX_MIN_M, BOX_MAX_M)
        robot, boxes = self._parts.robot, []
        for _ in range(rng.integers(1, BOXES_MAX + 1)):
            frames = robot.joint_poses((q_start + rng.random() * (q_goal - q_start))[None])[0]
            places = np.vstack([frames[len(frames) // 2 :, :3, 3], (frames[-1] @ robot.T_joint_tool)[:3, 3]])
            centre = places[rng.integers(len(places))] + rng.normal(scale=SPREAD_M, size=3)
            boxes.append(random_box(centre, *sizes, rng))
        return np.array(boxes)

    def _cells(self, boxes: F64) -> I32:
        parts = [box_cells(self._parts.grid, low, high) for low, high in boxes]
        cells = np.unique(np.concatenate(parts))
        return np.setdiff1d(cells, self._parts.roadmap.table.unavoidable).astype(np.int32)

    def _fits(self, q_start: F64, q_goal: F64, cells: I32) -> bool:
        n_cells = len(cells) * (self._parts.grid.resolution_m / CELL_M) ** 3
        if self._name != "wall" and not CELLS_MIN <= n_cells <= CELLS_MAX:
            return False
        seen = cells_of(self._parts.grid, cells)
        if any(self._checker.pose(seen, q)[0] != FREE for q in (q_start, q_goal)) or self._checker.segment(seen, q_start, q_goal):
            return False
        if self._name != "wall":
            return True
        self._counts.set_cells(cells)
        return self._counts.n_blocked > self._parts.roadmap.n_neurons / 2
