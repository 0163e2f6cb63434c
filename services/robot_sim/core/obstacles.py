"""The obstacles of the cell: who is there, how each moves, and the manners that keep a moving one off an arm that stands."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from common.errors import RequestError
from services.robot_sim.core.scripts import Drift, Leg, Pose, Script

__all__ = ["Manners", "Obstacles", "Thing", "Waypoint", "pose_of"]

F64 = NDArray[np.float64]
Shape = Literal["box", "sphere", "cylinder", "capsule"]
N_SIZES = {"box": 3, "sphere": 1, "cylinder": 2, "capsule": 2}
MAX_SIZE_M = 5.0  # our choice: larger than any cell, small enough for the physics engine
MAX_DISTANCE_M = 100.0  # likewise
MAX_SPEED_M_S = 10.0  # likewise
MAX_WAYPOINTS = 1000  # likewise
LEAST_APPROACH_M = 1e-6  # rounding of the engine's distances must not make a leaving hand wait


@dataclass(frozen=True, eq=False)
class Thing:
    """One obstacle. ``size_m``: box 3 full extents; sphere [radius]; cylinder, capsule [radius, length along z].

    A capsule's length is that of its cylindrical part, as in PyBullet and coal.
    """

    id: str
    shape: Shape
    size_m: tuple[float, ...]
    pose: Pose
    velocity_m_s: F64
    motion: Script | Drift | None = None
    waits: bool = False  # for the arm to give it room


@dataclass(frozen=True)
class Waypoint:
    """As asked for: no quaternion means the orientation before."""

    position_m: Sequence[float]
    quaternion_xyzw: Sequence[float] | None
    speed_m_s: float
    rest_s: float


@dataclass(frozen=True)
class Manners:
    """An obstacle comes no nearer than ``gap_m`` to an arm that stands; once it waits, it goes on when there is ``room_m``."""

    gap_m: float
    room_m: float


class Obstacles:
    """All obstacles by id. Every command is checked in full before anything changes; what cannot be is a RequestError."""

    def __init__(self, max_obstacles: int, reserved: Sequence[str] = ()) -> None:
        self._max = max_obstacles
        self._reserved = frozenset(reserved)
        self._things: dict[str, Thing] = {}

    def all(self) -> list[Thing]:
        """The obstacles in the order in which they came."""
        return list(self._things.values())

    def add(self, id: str, shape: str | None, size_m: Sequence[float] | None, pose: Pose, velocity_m_s: Sequence[float] | None) -> Thing:
        """A new obstacle; with a velocity it drifts.

        Raises:
            RequestError: id empty, taken or the name of a fixed thing; unknown shape; sizes; too many.
        """
        if not id or id in self._reserved:
            raise RequestError(f"obstacle id {id!r} is empty or the name of a part of the cell", facts={"id": id})
        if id in self._things:
            raise RequestError(f"obstacle {id!r} is there already", code="duplicate_id", facts={"id": id})
        if len(self._things) >= self._max:
            raise RequestError(f"there are {self._max} obstacles, no more are taken", code="too_many", facts={"max": self._max})
        if shape not in N_SIZES:
            raise RequestError(
                f"shape {shape!r} cannot be simulated, only {sorted(N_SIZES)}", code="unsupported_shape", facts={"shape": shape}
            )
        thing = Thing(id, shape, _sizes(shape, size_m), pose, *_drift(velocity_m_s))  # type: ignore[arg-type]  # narrowed above
        self._things[id] = thing
        return thing

    def move(self, id: str, pose: Pose | None, velocity_m_s: Sequence[float] | None) -> Thing:
        """Put it there at once (None: leave it) and end its script; with a velocity it drifts from there.

        Raises:
            RequestError: unknown id, velocity malformed.
        """
        thing = self.get(id)
        velocity, motion = _drift(velocity_m_s)
        return self._put(replace(thing, pose=pose or thing.pose, velocity_m_s=velocity, motion=motion, waits=False))

    def script(self, id: str, waypoints: Sequence[Waypoint], loop: bool) -> Thing:
        """Let it move along waypoints from where it is.

        Raises:
            RequestError: unknown id, no or too many waypoints, a malformed one.
        """
        thing = self.get(id)
        if not 0 < len(waypoints) <= MAX_WAYPOINTS:
            raise RequestError(f"a script has 1 to {MAX_WAYPOINTS} waypoints, got {len(waypoints)}", facts={"id": id})
        legs = []
        quaternion: Sequence[float] | F64 = thing.pose.quaternion_xyzw
        for i, w in enumerate(waypoints):
            quaternion = quaternion if w.quaternion_xyzw is None else w.quaternion_xyzw
            if not (np.isfinite(w.speed_m_s) and 0.0 < w.speed_m_s <= MAX_SPEED_M_S):
                raise RequestError(f"waypoint {i}: speed_m_s {w.speed_m_s} is not in (0, {MAX_SPEED_M_S}]", facts={"id": id})
            if not (np.isfinite(w.rest_s) and w.rest_s >= 0.0):
                raise RequestError(f"waypoint {i}: rest_s {w.rest_s} is not a time", facts={"id": id})
            legs.append(Leg(pose_of(w.position_m, quaternion, f"waypoint {i}"), w.speed_m_s, w.rest_s))
        return self._put(replace(thing, motion=Script(tuple(legs), loop, thing.pose), velocity_m_s=np.zeros(3), waits=False))

    def remove(self, id: str) -> None:
        """Take it away.

        Raises:
            RequestError: unknown id.
        """
        self.get(id)
        del self._things[id]

    def clear(self) -> None:
        """Take all away."""
        self._things.clear()

    def get(self, id: str) -> Thing:
        """The obstacle of that id.

        Raises:
            RequestError: there is none.
        """
        if id not in self._things:
            raise RequestError(f"there is no obstacle {id!r}", code="unknown_id", facts={"id": id})
        return self._things[id]

    def step(self, dt_s: float, gap_m: Callable[[Thing, Pose], float], manners: Manners, arm_stands: bool) -> list[Thing]:
        """Move those that move, and return them.

        Args:
            dt_s: time that passes.
            gap_m: distance between the arm and an obstacle at a pose, exact up to ``manners.room_m``.
            manners: how a standing arm is approached: who waits stays where it is, and its script stands still.
            arm_stands: an arm that moves is approached by all that do not wait already.
        """
        moved = []
        for thing in self.all():
            if thing.motion is None:
                continue
            motion, pose, velocity = thing.motion.step(thing.pose, dt_s)
            polite_gap_m = manners.room_m if thing.waits else manners.gap_m
            if (arm_stands or thing.waits) and _approaches(gap_m, thing, pose, polite_gap_m):
                moved.append(self._put(replace(thing, velocity_m_s=np.zeros(3), waits=True)))
                continue
            moved.append(self._put(replace(thing, pose=pose, velocity_m_s=velocity, motion=motion, waits=False)))
        return moved

    def _put(self, thing: Thing) -> Thing:
        self._things[thing.id] = thing
        return thing


def pose_of(position_m: Sequence[float] | None, quaternion_xyzw: Sequence[float] | F64 | None, place: str) -> Pose:
    """A checked pose; no quaternion means no rotation.

    Raises:
        RequestError: wrong count, a value not finite or far away, a quaternion of length zero.
    """
    position = np.asarray([] if position_m is None else position_m, dtype=np.float64)
    if position.shape != (3,) or not np.all(np.abs(position) <= MAX_DISTANCE_M):
        raise RequestError(
            f"{place}: position_m {position.tolist()} is not three numbers within {MAX_DISTANCE_M:g} m", facts={"place": place}
        )
    quaternion = np.asarray([0.0, 0.0, 0.0, 1.0] if quaternion_xyzw is None else quaternion_xyzw, dtype=np.float64)
    length = float(np.linalg.norm(quaternion)) if quaternion.shape == (4,) else np.nan
    if not (np.isfinite(length) and length > 1e-6):
        raise RequestError(f"{place}: quaternion_xyzw {quaternion.tolist()} is not a rotation", facts={"place": place})
    return Pose(position, quaternion / length)


def _sizes(shape: str, size_m: Sequence[float] | None) -> tuple[float, ...]:
    sizes = tuple(float(s) for s in size_m or ())
    if len(sizes) != N_SIZES[shape] or not all(0.0 < s <= MAX_SIZE_M for s in sizes):
        raise RequestError(
            f"size_m {list(sizes)}: a {shape} has {N_SIZES[shape]} sizes in (0, {MAX_SIZE_M:g}] m",
            facts={"shape": shape, "size_m": list(sizes)},
        )
    return sizes


def _drift(velocity_m_s: Sequence[float] | None) -> tuple[F64, Drift | None]:
    velocity = np.asarray([0.0, 0.0, 0.0] if velocity_m_s is None else velocity_m_s, dtype=np.float64)
    if velocity.shape != (3,) or not np.all(np.abs(velocity) <= MAX_SPEED_M_S):
        raise RequestError(f"velocity_m_s {velocity.tolist()} is not three numbers within {MAX_SPEED_M_S:g} m/s")
    return velocity, Drift(velocity) if velocity.any() else None


def _approaches(gap_m: Callable[[Thing, Pose], float], thing: Thing, pose: Pose, polite_gap_m: float) -> bool:
    gap_next_m = gap_m(thing, pose)
    return gap_next_m < polite_gap_m and gap_next_m < gap_m(thing, thing.pose) - LEAST_APPROACH_M
