"""Where the guiding hand is at each instant: from waypoints to poses at equal times. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from common.errors import RequestError
from services.robot_sim.config import GuideConfig

__all__ = ["STEP_S", "HandPath", "HandPoint", "hand_path"]

F64 = NDArray[np.float64]
STEP_S = 0.02  # our choice: 5 mm at the speed of a hand; also the time between two knots of what is driven

ROUNDING = 1e-6  # of a step: what is a whole number of steps but for rounding is no step more
MAX_POINTS = 100  # waypoints of one guide; our choice: bounds what one command may cost in a control cycle


@dataclass(frozen=True)
class HandPoint:
    """A waypoint of the hand: position, orientation (None: as before), speed on the way there, rest when there."""

    position_m: Sequence[float]
    quaternion_xyzw: Sequence[float] | None
    speed_m_s: float
    rest_s: float


@dataclass(frozen=True, eq=False)
class HandPath:
    """Poses of the hand every ``STEP_S``: ``position_m`` (H, 3), ``rotation`` (H, 3, 3); ``arrives`` (W,) step at each waypoint."""

    position_m: F64
    rotation: F64
    arrives: NDArray[np.int64]


def hand_path(T_world_tool: F64, points: Sequence[HandPoint], config: GuideConfig) -> HandPath:
    """The hand takes the tool where it is and carries it from waypoint to waypoint, straight and at constant speed.

    Args:
        T_world_tool: (4, 4) where the tool is.
        points: where to.
        config: bounds of speed and duration.

    Raises:
        RequestError: no waypoints, a number that makes no sense, or too long a way; names the waypoint and the value.
    """
    if not 0 < len(points) <= MAX_POINTS:
        raise RequestError(f"waypoints: {len(points)} given, 1 to {MAX_POINTS} are taken", code="bad_guide")
    position, turn = T_world_tool[:3, 3], Rotation.from_matrix(T_world_tool[:3, :3])
    positions, rotations, arrives, n = [position[None]], [turn.as_matrix()[None]], [], 1
    for i, point in enumerate(points):
        _check(i, point, config)
        to = np.asarray(point.position_m, dtype=np.float64)
        to_turn = turn if point.quaternion_xyzw is None else Rotation.from_quat(point.quaternion_xyzw)
        angle_rad = float((to_turn * turn.inv()).magnitude())
        way_s = max(math.dist(to, position) / point.speed_m_s, angle_rad / config.turn_speed_rad_s)
        end_s = n * STEP_S + way_s + point.rest_s
        if end_s > config.duration_max_s:
            text = f"waypoints[{i}]: the hand is done there after {end_s:.1f} s, at most {config.duration_max_s:g} s are guided"
            raise RequestError(text, code="too_long", facts={"index": i})
        n_way, n_rest = (math.ceil(seconds / STEP_S - ROUNDING) for seconds in (way_s, point.rest_s))
        share = np.concatenate([np.arange(1, n_way + 1) / max(n_way, 1), np.ones(n_rest)])
        if len(share):
            positions.append(position + share[:, None] * (to - position))
            rotations.append(Slerp([0.0, 1.0], Rotation.concatenate([turn, to_turn]))(share).as_matrix())
        n += len(share)
        arrives.append(n - 1)
        position, turn = to, to_turn
    return HandPath(np.concatenate(positions), np.concatenate(rotations), np.array(arrives, dtype=np.int64))


def _check(i: int, point: HandPoint, config: GuideConfig) -> None:
    place = f"waypoints[{i}]"
    quaternion = point.quaternion_xyzw
    for name, values, count in (("position_m", point.position_m, 3), ("quaternion_xyzw", quaternion, 4)):
        if values is not None and (len(values) != count or not np.all(np.isfinite(values))):
            raise RequestError(f"{place}.{name}: needs {count} finite numbers, got {list(values)!r}", code="bad_guide")
    if quaternion is not None and np.linalg.norm(quaternion) < 1e-6:
        raise RequestError(f"{place}.quaternion_xyzw: has no length", code="bad_guide")
    if not 0.0 < point.speed_m_s <= config.speed_max_m_s:
        raise RequestError(f"{place}.speed_m_s: {point.speed_m_s} is outside (0, {config.speed_max_m_s:g}]", code="out_of_range")
    if not 0.0 <= point.rest_s <= config.duration_max_s:
        raise RequestError(f"{place}.rest_s: {point.rest_s} is outside [0, {config.duration_max_s:g}]", code="out_of_range")
