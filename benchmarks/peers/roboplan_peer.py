"""RRTConnect and shortcuts of roboplan (wheel ``roboplan``, 0.7.0), all of it in C++, with the cells as its octree.

How it is treated (figures: 30 questions of the set ``task`` of another seed, three seeds each):

* The arm is the same convex pieces that OMPL's checker gets; a check takes 8 to 10 us (bare meshes: 14 to 23 us).
* roboplan knows no margins. Cells are grown by the safety distance, as leaves of the octree: at edges of things that is up to 8 mm more
  than asked for. That blocks start or goal of 3 of 130 questions that keep the distance; then leaves of half the edge round it off (at
  edges 6 mm less to 8 mm more; 1 of 130 stays blocked). No question with free ends is lost by it. The static layer's shapes are grown by
  their margin; between the arm's own bodies it keeps none.
* A motion is checked every 0.03 rad, Euclidean in joint space, by bisection.
* Longest connection: tried 0.5, 1, 1.5, 2, 3, 5 rad: plan p50 7.2, 4.8, 3.8, 3.1, 3.2, 3.6 ms.
* Simplified means its ``PathShortcutter`` as it comes (100 attempts, 20 in vain at most): 11 ms, length 10.5 -> 6.9 rad. 500 attempts:
  66 ms, 6.7 rad; 30: 9 ms, 7.0 rad. It knows no time limit.

Seeds are arguments: equal seeds give equal paths as long as no time limit cuts in.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from roboplan.core import JointConfiguration, JointPath, OcTree, PathShortcutter, PathShortcuttingOptions, Scene
from roboplan.rrt import RRT, RRTOptions

from benchmarks.peers.cells import coarsest_split, grown_leaves
from benchmarks.peers.peer import STEP_RAD, TIME_LIMIT_S, PeerAnswer, Setting, Watch
from benchmarks.peers.roboplan_scene import FIXTURES, link_name, make_scene
from benchmarks.questions import Question

__all__ = ["RoboplanPeer", "make"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]

CELLS = "cells"
OCCUPIED, THRESHOLD = 0.97, 0.5  # octomap's probabilities: any above the threshold would do
MAX_NODES = 100_000  # as in roboplan's own benchmarks: time is the limit, not nodes
COLOUR = np.ones(4)


class RoboplanPeer:
    """roboplan's RRTConnect."""

    name = "roboplan_rrt_connect"

    def __init__(self, setting: Setting) -> None:
        self._setting = setting
        self._scene: Scene | None = None
        self._has_cells = False

    def prepare(self) -> None:
        """roboplan's scene: arm and static layer."""
        self._scene = make_scene(self._setting)
        self._has_cells = False

    def solve(self, question: Question, time_limit_s: float = TIME_LIMIT_S, seed: int = 0, simplify: bool = True) -> PeerAnswer:
        """See :class:`benchmarks.peers.peer.Peer`."""
        if self._scene is None:
            self.prepare()
        assert self._scene is not None
        watch = Watch()
        self._take_in(self._scene, question)
        watch.lap("world")
        planner = RRT(self._scene, _options(time_limit_s))
        planner.setRngSeed(seed)
        try:
            path = planner.plan(self._configuration(question.q_start), self._configuration(question.q_goal))
        except RuntimeError as error:  # how it says that there is no path, or that an end is not free
            watch.lap("plan")
            return PeerAnswer(None, None, watch.seconds(), str(error))
        watch.lap("plan")
        raw = _corners(path)
        answer = raw
        if simplify:
            answer = _corners(PathShortcutter(self._scene, _shortcuts(seed)).shortcut(path))
            watch.lap("simplify")
        return PeerAnswer(answer, raw, watch.seconds())

    def _take_in(self, scene: Scene, question: Question) -> None:
        """The coarsest growth that has the margin; half of it if that blocks an end."""
        coarsest = coarsest_split(self._setting.grid, self._setting.margins.safety_m)
        for split in (coarsest, 2 * coarsest):
            self._replace_cells(scene, question.cells, split)
            if not any(scene.hasCollisions(np.ascontiguousarray(q)) for q in (question.q_start, question.q_goal)):
                return

    def _replace_cells(self, scene: Scene, cells: I32, split: int) -> None:
        if self._has_cells:
            scene.removeGeometry(CELLS)
        self._has_cells = len(cells) > 0
        if not self._has_cells:
            return
        grid = self._setting.grid
        centres, leaf_m = grown_leaves(grid, cells, self._setting.margins.safety_m, split), grid.resolution_m / split
        T_world_grid = np.eye(4)
        T_world_grid[:3, 3] = grid.origin_m  # an octree's leaves lie on multiples of its resolution
        leaves = np.empty((len(centres), 6))
        leaves[:, :3] = centres - grid.origin_m
        leaves[:, 3:] = leaf_m, OCCUPIED, THRESHOLD
        scene.addOcTreeGeometry(CELLS, "universe", OcTree(list(leaves), leaf_m), T_world_grid, COLOUR)
        immobile = [link_name(body) for body in self._setting.robot.bodies if body.immobile]
        scene.setCollisions([(CELLS, name) for name in (FIXTURES, *immobile)], False)

    def _configuration(self, q_rad: F64) -> JointConfiguration:
        return JointConfiguration(list(self._setting.robot.joint_names), np.ascontiguousarray(q_rad))


def _options(time_limit_s: float) -> RRTOptions:
    return RRTOptions(
        max_nodes=MAX_NODES,
        max_connection_distance=2.0,
        collision_check_step_size=STEP_RAD,
        max_planning_time=time_limit_s,
        rrt_connect=True,
    )


def _shortcuts(seed: int) -> PathShortcuttingOptions:
    return PathShortcuttingOptions(max_step_size=STEP_RAD, seed=seed)


def _corners(path: JointPath) -> F64:
    return np.array(path.positions, dtype=np.float64)


def make(name: str, setting: Setting) -> RoboplanPeer:
    """The peer called ``name``: there is only one."""
    assert name == RoboplanPeer.name
    return RoboplanPeer(setting)
