"""Motions of obstacles: from waypoint to waypoint at a speed, resting in between; or adrift at a constant velocity."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

__all__ = ["TURN_SPEED_RAD_S", "Drift", "Leg", "Pose", "Script"]

F64 = NDArray[np.float64]
TURN_SPEED_RAD_S = 1.0  # a leg that only turns has no length to time it by; our choice


@dataclass(frozen=True, eq=False)
class Pose:
    """Position (3,) in metres and quaternion x, y, z, w (4,), normalised; world frame."""

    position_m: F64
    quaternion_xyzw: F64


@dataclass(frozen=True, eq=False)
class Leg:
    """Go to ``target`` at ``speed_m_s``, then rest."""

    target: Pose
    speed_m_s: float
    rest_s: float


@dataclass(frozen=True, eq=False)
class Drift:
    """Constant velocity (3,), for ever."""

    velocity_m_s: F64

    def step(self, pose: Pose, dt_s: float) -> tuple[Drift, Pose, F64]:
        """The motion that goes on, the pose after ``dt_s``, and the velocity there."""
        return self, Pose(pose.position_m + dt_s * self.velocity_m_s, pose.quaternion_xyzw), self.velocity_m_s


@dataclass(frozen=True, eq=False)
class Script:
    """Legs in order, once or in a loop; ``origin`` is where the leg under way began, ``elapsed_s`` how long ago (rest included)."""

    legs: tuple[Leg, ...]
    loop: bool
    origin: Pose
    index: int = 0
    elapsed_s: float = 0.0

    def step(self, pose: Pose, dt_s: float) -> tuple[Script | None, Pose, F64]:
        """The motion that goes on (None: it is over), the pose after ``dt_s``, and the velocity (3,) there."""
        del pose  # the script knows where it is
        script, left_s = self, dt_s
        for _ in range(len(self.legs) + 1):  # legs of no duration cannot hold it up for ever
            rest_left_s = script.travel_s + script.legs[script.index].rest_s - script.elapsed_s
            if left_s < rest_left_s:
                break
            left_s -= max(rest_left_s, 0.0)
            target = script.legs[script.index].target
            following = script.index + 1
            if following == len(script.legs) and not script.loop:
                return None, target, np.zeros(3)
            script = Script(script.legs, script.loop, target, following % len(script.legs))
        elapsed_s = script.elapsed_s + left_s
        return replace(script, elapsed_s=elapsed_s), *script._at(elapsed_s)

    @cached_property
    def travel_s(self) -> float:
        """How long the leg under way moves before it rests."""
        leg = self.legs[self.index]
        way_m = float(np.linalg.norm(leg.target.position_m - self.origin.position_m))
        if way_m > 0.0:
            return way_m / leg.speed_m_s
        return _angle(self.origin.quaternion_xyzw, leg.target.quaternion_xyzw) / TURN_SPEED_RAD_S

    def _at(self, elapsed_s: float) -> tuple[Pose, F64]:
        leg, travel_s = self.legs[self.index], self.travel_s
        if elapsed_s >= travel_s:
            return leg.target, np.zeros(3)
        share = elapsed_s / travel_s
        way = leg.target.position_m - self.origin.position_m
        quaternion = _slerp(self.origin.quaternion_xyzw, leg.target.quaternion_xyzw, share)
        return Pose(self.origin.position_m + share * way, quaternion), way / travel_s


def _angle(a_xyzw: F64, b_xyzw: F64) -> float:
    """Angle of the shorter turn between two unit quaternions."""
    return 2.0 * math.acos(min(abs(float(a_xyzw @ b_xyzw)), 1.0))


def _slerp(a_xyzw: F64, b_xyzw: F64, share: float) -> F64:
    """The unit quaternion at ``share`` of the shorter turn (Shoemake 1985); scipy's takes ten times as long, at every cycle."""
    half = _angle(a_xyzw, b_xyzw) / 2.0
    if half < 1e-6:
        return a_xyzw
    b = b_xyzw if float(a_xyzw @ b_xyzw) >= 0.0 else -b_xyzw
    return np.asarray((math.sin((1.0 - share) * half) * a_xyzw + math.sin(share * half) * b) / math.sin(half))
