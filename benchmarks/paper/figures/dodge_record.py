"""Records a running stack and finds the best dodge in it: the moments that the photo series shows, and their file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from clients.demo.arm import Arm
from clients.demo.moment import Moment
from common.errors import ArtefactError
from common.robot.trajectory import JointTrajectory
from common.wire.messages import Message, RobotState, Trajectory, VoxelFrame

__all__ = ["Dodge", "Recorder", "read_dodge", "write_dodge"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
STATE_GAP_NS, VOXEL_GAP_NS = 40_000_000, 100_000_000  # our choice: 25 and 10 Hz are enough for pictures
BEFORE_S = 0.25  # the first photo: so long before the new way came
N_PHOTOS = 6
PLANNED_SAMPLES = 80
LEAST_BEND_M = 0.05  # a new way that differs by less is no dodge
LEAST_LEFT_S = 0.8  # of the new motion, so that there is something to see
FEWEST_CELLS = 20  # seen when the new way came


@dataclass(frozen=True, eq=False)
class Dodge:
    """Photos of one dodge: seconds after the new way came, and what was to be seen then. ``bend_m``: how far the two ways are apart."""

    at_s: tuple[float, ...]
    photos: tuple[Moment, ...]
    bend_m: float


@dataclass(eq=False)
class Recorder:
    """Feed it every message; ask for the best dodge at the end."""

    arm: Arm
    states: list[RobotState] = field(default_factory=list)
    frames: list[VoxelFrame] = field(default_factory=list)
    ways: list[Trajectory] = field(default_factory=list)

    def observe(self, message: Message) -> None:
        """Take in one message of any channel."""
        if isinstance(message, RobotState) and (not self.states or message.stamp_ns - self.states[-1].stamp_ns >= STATE_GAP_NS):
            self.states.append(message)
        elif isinstance(message, VoxelFrame) and (not self.frames or message.stamp_ns - self.frames[-1].stamp_ns >= VOXEL_GAP_NS):
            self.frames.append(message)
        elif isinstance(message, Trajectory) and (not self.ways or message.id != self.ways[-1].id):
            self.ways.append(message)

    def best(self) -> Dodge | None:
        """The new way, taken in motion, that bends most from the one before; None if there was none."""
        best, most_m = None, LEAST_BEND_M
        for before, after in zip(self.ways[:-1], self.ways[1:], strict=True):
            bend_m = self._bend_m(before, after)
            if bend_m > most_m:
                best, most_m = after, bend_m
        return None if best is None else self._photos(best, most_m)

    def _bend_m(self, before: Trajectory, after: Trajectory) -> float:
        """How far the tool's new way leads from the old one; 0 where it is no dodge."""
        is_motion = before.kind == after.kind == "motion" and before.goal_id == after.goal_id
        if not is_motion or after.splice_time_s is None or float(after.t_s[-1]) < LEAST_LEFT_S:
            return 0.0
        seen = [frame for frame in self.frames if frame.stamp_ns <= after.stamp_ns]
        driven = [state for state in self.states if state.trajectory_id == after.id]
        if not seen or len(seen[-1].cells) < FEWEST_CELLS or not driven:
            return 0.0
        old_m, new_m = (self.arm.tool_positions(_sampled(way)) for way in (before, after))
        return float(cdist(new_m, old_m).min(axis=1).max())

    def _photos(self, way: Trajectory, bend_m: float) -> Dodge:
        of_goal = [state for state in self.states if self._goal_of(state) == way.goal_id]
        last_ns = of_goal[-1].stamp_ns
        wanted = [
            way.stamp_ns - int(BEFORE_S * 1e9),
            *(way.stamp_ns + k * (last_ns - way.stamp_ns) // (N_PHOTOS - 2) for k in range(N_PHOTOS - 1)),
        ]
        photos = [self._photo(of_goal, at_ns) for at_ns in wanted]
        return Dodge(tuple((at_ns - way.stamp_ns) / 1e9 for at_ns in wanted), tuple(photos), bend_m)

    def _goal_of(self, state: RobotState) -> str:
        return next((way.goal_id for way in self.ways if way.id == state.trajectory_id), "")

    def _photo(self, of_goal: Sequence[RobotState], at_ns: int) -> Moment:
        trail = [state for state in of_goal if state.stamp_ns <= at_ns] or [of_goal[0]]
        frame = next((f for f in reversed(self.frames) if f.stamp_ns <= at_ns), self.frames[0])
        goal = self._goal_of(of_goal[0])
        way = next((w for w in reversed(self.ways) if w.stamp_ns <= at_ns and w.goal_id == goal), None)
        planned = _sampled(way) if way is not None else np.empty((0, len(trail[0].q_rad)))
        ijk = np.stack(np.unravel_index(frame.cells, frame.grid.shape), axis=-1)
        cells_m = np.asarray(frame.grid.origin_m) + (ijk + 0.5) * frame.grid.resolution_m
        return Moment(trail[-1].q_rad, cells_m, frame.grid.resolution_m, planned, np.array([state.q_rad for state in trail]))


def _sampled(way: Trajectory) -> F64:
    curve = JointTrajectory(way.t_s, way.q_rad, way.dq_rad_s)
    return curve.sample(np.linspace(0.0, curve.duration_s, PLANNED_SAMPLES))[0]


def write_dodge(dodge: Dodge, path: Path) -> None:
    """Keep the photos' data; :func:`read_dodge` reads them."""
    path.parent.mkdir(parents=True, exist_ok=True)
    arrays = {"at_s": np.array(dodge.at_s), "bend_m": np.array(dodge.bend_m), "resolution_m": np.array(dodge.photos[0].resolution_m)}
    for k, photo in enumerate(dodge.photos):
        arrays |= {
            f"q_{k}": photo.q_rad,
            f"cells_{k}": photo.cells_m,
            f"planned_{k}": photo.planned_q_rad,
            f"driven_{k}": photo.driven_q_rad,
        }
    with path.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)


def read_dodge(path: Path) -> Dodge:
    """A recorded dodge.

    Raises:
        ArtefactError: not there, or no recorded dodge.
    """
    try:
        with np.load(path, allow_pickle=False) as kept:
            resolution_m = float(kept["resolution_m"])
            photos = [
                Moment(kept[f"q_{k}"], kept[f"cells_{k}"], resolution_m, kept[f"planned_{k}"], kept[f"driven_{k}"])
                for k in range(len(kept["at_s"]))
            ]
            return Dodge(tuple(kept["at_s"].tolist()), tuple(photos), float(kept["bend_m"]))
    except (OSError, ValueError, KeyError) as error:
        raise ArtefactError(f"--dodge {path}: no recorded dodge: {error}", code="torn_dodge") from None
