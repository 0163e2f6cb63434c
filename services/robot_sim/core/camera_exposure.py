"""The scene at the instant of an exposure, which lies between published samples: obstacles are carried on by their velocity."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from common.geometry.transforms import pose_matrix
from services.robot_sim.core.camera_shapes import SHAPES, PlacedShape, ShapeName

__all__ = ["MovingShape", "SceneHistory", "moving_shape"]

SCENES_KEPT = 8  # a quarter of a second at 30 Hz; exposures lie one or two samples back


@dataclass(frozen=True, eq=False)
class MovingShape:
    """A solid with the velocity (3,) m/s of its origin; its turning is not published and not carried on."""

    placed: PlacedShape
    velocity_m_s: tuple[float, float, float]

    def after(self, seconds: float) -> PlacedShape:
        """Where it is later (or earlier)."""
        T = self.placed.T_world_shape.copy()
        T[:3, 3] += np.asarray(self.velocity_m_s) * seconds
        return PlacedShape(self.placed.shape, self.placed.size_m, T)


def moving_shape(
    shape: str, size_m: Sequence[float], position_m: Sequence[float], quaternion_xyzw: Sequence[float], velocity_m_s: Sequence[float]
) -> MovingShape | str:
    """A published obstacle as a solid that can be drawn, or what is wrong with it."""
    if shape not in SHAPES:
        return f"shape {shape!r} cannot be drawn, only {sorted(SHAPES)}"
    _, n_sizes = SHAPES[shape]
    sizes = (len(size_m), len(position_m), len(quaternion_xyzw), len(velocity_m_s))
    if sizes != (n_sizes, 3, 4, 3):
        return f"{shape}: expected {n_sizes} sizes, 3 coordinates, 4 of a quaternion, 3 of a velocity, got {sizes}"
    if not np.isfinite([*size_m, *position_m, *quaternion_xyzw, *velocity_m_s]).all():
        return f"{shape}: a value is not finite"
    if min(size_m) <= 0.0 or np.linalg.norm(quaternion_xyzw) == 0.0:
        return f"{shape}: sizes must be above zero and the quaternion not zero"
    vx, vy, vz = velocity_m_s
    return MovingShape(PlacedShape(cast(ShapeName, shape), tuple(size_m), pose_matrix(position_m, quaternion_xyzw)), (vx, vy, vz))


class SceneHistory:
    """The last scenes by stamp (the sender's time).

    Args:
        max_extrapolation_s: a scene older than this stays where it was then: its publisher has stopped, not the world.
    """

    def __init__(self, *, max_extrapolation_s: float) -> None:
        self._max_s = max_extrapolation_s
        self._scenes: deque[tuple[int, list[MovingShape]]] = deque(maxlen=SCENES_KEPT)

    def add(self, stamp_ns: int, shapes: list[MovingShape]) -> None:
        """Take a scene; a stamp that goes back means that the simulation was started anew."""
        if self._scenes and stamp_ns < self._scenes[-1][0]:
            self._scenes.clear()
        self._scenes.append((stamp_ns, shapes))

    def at(self, stamp_ns: int) -> list[PlacedShape] | None:
        """The solids at an instant: the newest scene not after it, moved on; None before the first scene."""
        if not self._scenes:
            return None
        then_ns, shapes = self._scenes[0]
        for candidate in self._scenes:
            if candidate[0] <= stamp_ns:
                then_ns, shapes = candidate
        seconds = min(max((stamp_ns - then_ns) * 1e-9, 0.0), self._max_s)
        return [shape.after(seconds) for shape in shapes]
