"""The cells that count as occupied, set by set: hits at once, misses in time, shadows behind what is seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.geometry.grid import Grid
from common.robot.kernels import BodyGrids
from services.perception.core.arm import ArmState
from services.perception.core.arm_kernels import arm_mask
from services.perception.core.background import Background
from services.perception.core.camera_view import CameraView
from services.perception.core.evidence_kernels import age, centres_with_bound, new_evidence, settle, shadow_candidates
from services.perception.core.look_kernels import OUT_OF_VIEW, PROBABLY_FREE, look_at_cells
from services.perception.core.splat_kernels import count, foreground, frame_of, new_counts

__all__ = ["Exposure", "Occupancy", "OccupancyRules"]

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]
MAX_CAMERAS = 8  # bits of a byte
HALF_DIAGONAL = np.sqrt(3.0) / 2.0


@dataclass(frozen=True)
class OccupancyRules:
    """Numbers of the evidence; see :class:`services.perception.config.PerceptionConfig`."""

    min_points: int
    strong_miss: int
    weak_miss: int
    clear_at: int
    unseen_decay_s: float
    shadow_depth_m: float


@dataclass(frozen=True, eq=False)
class Exposure:
    """One camera's part of a set: its image, its world points (P, 3) f4, and the arm at its instant."""

    camera: int
    view: CameraView
    points_m: F32
    arm: ArmState


class Occupancy:
    """Fuses sets of exposures. All buffers are as large as the grid and made once; a set costs by its points and cells, not by the grid."""

    def __init__(self, grid: Grid, background: Background, grids: BodyGrids, rules: OccupancyRules) -> None:
        self._grid, self._background, self._grids, self._rules = grid, background, grids, rules
        self._frame = frame_of(grid)
        self._counts = new_counts(grid.n_cells)
        self._evidence = new_evidence(grid.n_cells)
        self._n_active = 0
        self._set = 0
        self._verdict = np.zeros(grid.n_cells, np.uint8)
        self._inside = np.zeros(grid.n_cells, np.uint8)
        self._visited = np.full(grid.n_cells, -1, np.int64)
        self._candidates = np.zeros(grid.n_cells, np.int32)
        self._camera_m = np.zeros((MAX_CAMERAS, 3))
        self._n_touched = 0
        self.n_arm_points = 0
        self._points_m = np.empty((0, 4))
        self._point_cell = np.empty(0, np.int32)
        self._is_arm = np.empty(0, np.uint8)

    def rearm(self, grids: BodyGrids) -> None:
        """The arm has other bodies from now on (it holds something, or no more); what was seen stays."""
        self._grids = grids

    def begin(self) -> None:
        """Start a new set."""
        self._set += 1
        self._n_touched = 0
        self.n_arm_points = 0

    def splat(self, exposure: Exposure) -> None:
        """Count the points of one exposure of the set."""
        self._camera_m[exposure.camera] = exposure.view.translation
        self._reserve(len(exposure.points_m))
        view, arm = exposure.view, exposure.arm
        n = foreground(self._frame, exposure.points_m, view, self._background, arm.sigmas, self._points_m, self._point_cell)
        arm_mask(arm.bodies, self._grids, self._points_m, n, self._is_arm)
        self._n_touched, n_arm = count(self._point_cell, self._is_arm, n, view.bit, self._counts, self._n_touched)
        self.n_arm_points += n_arm

    def _reserve(self, n_points: int) -> None:
        """Room for the points of an image; grows once to the largest image."""
        if n_points > len(self._points_m):
            self._points_m = np.empty((n_points, 4))
            self._point_cell = np.empty(n_points, np.int32)
            self._is_arm = np.empty(n_points, np.uint8)

    def settle(self, exposures: Sequence[Exposure], now_s: float) -> None:
        """Hits of the set, then misses of the cells that had none."""
        rules = self._rules
        self._n_active = settle(self._counts, self._n_touched, rules.min_points, self._set, now_s, self._evidence, self._n_active)
        cells, n = self._evidence.active, self._n_active
        self._look(cells, n, exposures, 0.0)
        weights = (rules.strong_miss, rules.weak_miss, rules.clear_at)
        self._n_active = age(self._evidence, n, self._set, now_s, self._verdict, self._inside, weights, rules.unseen_decay_s)

    def shadows(self, exposures: Sequence[Exposure]) -> I32:
        """Cells (S,) in the shallow shadow of occupied ones that no exposure sees to be free and where the arm itself is not."""
        n = shadow_candidates(
            self._frame,
            self._evidence,
            self._n_active,
            self._camera_m,
            MAX_CAMERAS,
            self._rules.shadow_depth_m,
            self._set,
            self._visited,
            self._candidates,
        )
        self._look(self._candidates, n, exposures, self._grid.resolution_m * HALF_DIAGONAL)
        hidden = (self._verdict[:n] < PROBABLY_FREE) & (self._inside[:n] == 0)
        found: I32 = self._candidates[:n][hidden]
        return found

    def cells(self, shadows: I32) -> I32:
        """Ascending flat indices (C,) of all that counts as occupied."""
        return np.sort(np.concatenate([self._evidence.active[: self._n_active], shadows]))

    def _look(self, cells: I32, n: int, exposures: Sequence[Exposure], near_arm_m: float) -> None:
        self._verdict[:n] = OUT_OF_VIEW
        self._inside[:n] = 0
        self._reserve(n)
        for e in exposures:
            n_asked = look_at_cells(
                self._frame, cells, n, e.view, self._background, e.arm.sigmas, self._verdict, self._point_cell, self._points_m
            )
            arm_mask(e.arm.bodies, self._grids, self._points_m, n_asked, self._is_arm)
            before_arm = self._point_cell[:n_asked][self._is_arm[:n_asked] != 0]
            self._verdict[before_arm] = np.maximum(self._verdict[before_arm], PROBABLY_FREE)
        if exposures:
            centres_with_bound(self._frame, cells, n, near_arm_m, self._points_m)
            arm_mask(exposures[-1].arm.bodies, self._grids, self._points_m, n, self._inside)
