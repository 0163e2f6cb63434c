"""Planning problems from a file (MotionBenchMaker's, as JSON): sets of problems, each a start, a goal and the shapes of its scene.

The file: ``{"meta": {"joints": [...], "units": "m, rad"}, "problems": {set: [problem, ...]}}``. A problem has ``start_rad``, ``goal_rad``
and ``obstacles``, whose poses are in the frame of the robot's base; an obstacle is a ``box`` (``extents``: full edges), a ``cylinder``
(``radius``, ``height``, along its z) or a ``sphere`` (``radius``). ``index`` is optional: else a problem is numbered by its place, from 1.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from common.cell import SolidConfig
from common.config import Strict
from common.errors import ConfigError
from common.geometry.transforms import pose_matrix, rpy_matrix

__all__ = ["Problem", "read_problems"]

F64 = NDArray[np.float64]
Length = Annotated[float, Meta(gt=0)]
Vector3 = Annotated[list[float], Meta(min_length=3, max_length=3)]
UNITS = "m, rad"
QUATERNION_SLACK = 0.01  # a quaternion written with few digits is still one; our choice
SIZES: dict[str, tuple[str, ...]] = {"box": ("extents",), "cylinder": ("radius", "height"), "sphere": ("radius",)}


class _Obstacle(Strict, frozen=True):
    id: str
    shape: Literal["box", "cylinder", "sphere"]
    position_m: Vector3
    quaternion_xyzw: Annotated[list[float], Meta(min_length=4, max_length=4)]
    extents: Annotated[list[Length], Meta(min_length=3, max_length=3)] | None = None
    radius: Length | None = None
    height: Length | None = None

    def __post_init__(self) -> None:
        for size in ("extents", "radius", "height"):
            if (getattr(self, size) is None) == (size in SIZES[self.shape]):
                wants = " and ".join(SIZES[self.shape])
                raise ValueError(
                    f"{self.id}: a {self.shape} has {wants}; {size} is {'absent' if size in SIZES[self.shape] else 'too much'}"
                )
        numbers = [*self.position_m, *self.quaternion_xyzw, *(self.extents or []), self.radius or 0.0, self.height or 0.0]
        if not all(math.isfinite(number) for number in numbers):
            raise ValueError(f"{self.id}: a number is not finite")
        norm = math.hypot(*self.quaternion_xyzw)
        if abs(norm - 1.0) > QUATERNION_SLACK:
            raise ValueError(f"{self.id}: quaternion_xyzw has length {norm:.4g}, not 1")

    def solid(self, T_world_base: F64) -> SolidConfig:
        """The same as the planner names it, in the world."""
        T = T_world_base @ pose_matrix(self.position_m, self.quaternion_xyzw)
        rpy = Rotation.from_matrix(T[:3, :3]).as_euler("xyz")
        size = {"box": self.extents or [], "cylinder": [self.radius or 0.0, self.height or 0.0], "sphere": [self.radius or 0.0]}[self.shape]
        x, y, z = T[:3, 3].tolist()
        roll, pitch, yaw = rpy.tolist()
        return SolidConfig(name=self.id, shape=self.shape, size_m=size, position_m=(x, y, z), rpy_rad=(roll, pitch, yaw))


class _Record(msgspec.Struct, frozen=True):
    start_rad: list[float]
    goal_rad: list[float]
    obstacles: list[_Obstacle]
    index: int | None = None


class _Meta(msgspec.Struct, frozen=True):
    joints: list[str]
    units: str = UNITS


@dataclass(frozen=True, eq=False)
class Problem:
    """``q_start``, ``q_goal`` (J,) rad in the robot's joint order, and the scene's ``solids`` in the world; ``index`` within its set."""

    set_name: str
    index: int
    q_start: F64
    q_goal: F64
    solids: tuple[SolidConfig, ...]

    @property
    def name(self) -> str:
        """Set and index, for people."""
        return f"{self.set_name} {self.index}"


def read_problems(
    path: Path, joint_names: tuple[str, ...], base: tuple[tuple[float, float, float], tuple[float, float, float]]
) -> list[Problem]:
    """All problems of a file, set by set, in its order.

    Args:
        path: of the file.
        joint_names: (J,) of the robot that is to solve them; the file's joints are put into this order.
        base: position in metres and roll, pitch, yaw in rad of the robot's base in the world.

    Raises:
        ConfigError: ``bad_problems``: not readable, not JSON, other joints or units, or a problem malformed; names file, set, problem
            and field.
    """
    data = _read(path)
    meta = _convert(data.get("meta"), _Meta, f"{path}: meta")
    if meta.units != UNITS:
        raise _bad(f"{path}: meta.units is {meta.units!r}, this tolman reads {UNITS!r}")
    if sorted(meta.joints) != sorted(joint_names):
        raise _bad(f"{path}: meta.joints are {meta.joints}, the robot's joints are {list(joint_names)}")
    order = [meta.joints.index(name) for name in joint_names]
    sets = data.get("problems")
    if not isinstance(sets, dict) or not sets:
        raise _bad(f"{path}: problems must be an object of sets, each a list of problems")
    T_world_base = rpy_matrix(*base)
    problems = []
    for set_name, records in sets.items():
        if not isinstance(records, list) or not records:
            raise _bad(f"{path}: set {set_name}: must be a list of at least one problem")
        for number, record in enumerate(records, start=1):
            problems.append(
                _problem(f"{path}: set {set_name}, problem {_shown_index(record, number)}", set_name, number, record, order, T_world_base)
            )
    return problems


def _read(path: Path) -> dict[str, Any]:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise _bad(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:  # also bytes that are no UTF-8
        raise _bad(f"{path}: not JSON: {error}") from None
    if not isinstance(data, dict):
        raise _bad(f"{path}: must be an object with meta and problems")
    return data


def _problem(place: str, set_name: str, number: int, record: Any, order: list[int], T_world_base: F64) -> Problem:
    read = _convert(record, _Record, place)
    ends = []
    for field in ("start_rad", "goal_rad"):
        q = np.array(getattr(read, field), dtype=np.float64)
        if q.shape != (len(order),):
            raise _bad(f"{place}: {field} has {len(q)} values, the robot has {len(order)} joints")
        if not np.all(np.isfinite(q)):
            raise _bad(f"{place}: {field}[{int(np.argmin(np.isfinite(q)))}] is not a finite number")
        ends.append(q[order])
    solids = tuple(obstacle.solid(T_world_base) for obstacle in read.obstacles)
    q_start, q_goal = ends
    return Problem(set_name, number if read.index is None else read.index, q_start, q_goal, solids)


def _shown_index(record: Any, number: int) -> str:
    index = record.get("index") if isinstance(record, dict) else None
    return str(number if not isinstance(index, int) else index)


def _convert(value: Any, kind: Any, place: str) -> Any:
    try:
        return msgspec.convert(value, kind, strict=True)
    except msgspec.ValidationError as error:
        raise _bad(f"{place}: {error}") from None


def _bad(message: str) -> ConfigError:
    return ConfigError(message, code="bad_problems")
