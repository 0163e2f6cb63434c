"""The slow obvious twin of perception's kernels: dicts and loops, no flat state. One class does what ``Occupancy`` does."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from common.geometry.grid import Grid
from common.geometry.transforms import invert, rpy_matrix
from common.robot.kernels import FAR
from services.perception.core.arm import LARGEST_DISTANCE_M
from services.perception.core.background_kernels import LARGEST_BOUND_M
from services.perception.core.occupancy import Exposure, OccupancyRules

OUT_OF_VIEW, NO_EVIDENCE, PROBABLY_FREE, SEEN_THROUGH = range(4)


def distance_to_solid(solid, point) -> float:
    p = (invert(rpy_matrix(solid.position_m, solid.rpy_rad)) @ [*point, 1.0])[:3]
    if solid.shape == "sphere":
        return float(np.linalg.norm(p)) - solid.size_m[0]
    if solid.shape == "cylinder":
        q = np.array([math.hypot(p[0], p[1]) - solid.size_m[0], abs(p[2]) - solid.size_m[1] / 2])
    else:
        q = np.abs(p) - np.array(solid.size_m) / 2
    return float(np.linalg.norm(np.maximum(q, 0))) + min(float(q.max()), 0.0)


def distance_to_body(grids, joint_poses, b: int, point) -> float:
    """By the body's own table, as the kernel must."""
    p = (invert(joint_poses[grids.body_joint[b]]) @ [*point, 1.0])[:3]
    index = np.floor((p - grids.origin_m[b]) / grids.spacing_m).astype(int)
    shape = tuple(grids.shape[b])
    if np.any(index < 0) or np.any(index >= shape):
        return FAR
    table = grids.distance[grids.offset[b] : grids.offset[b + 1]].reshape(shape)
    return float(table[tuple(index)]) * 1e-4


@dataclass
class Belief:
    cameras: int
    misses: int
    in_view_s: float


@dataclass
class SlowOccupancy:
    """``joint_poses``: (J + 1, 4, 4) of the arm at the exposures of the set about to be fused."""

    grid: Grid
    solids: list
    table_z_m: float
    sigmas: float
    plane_sigmas: float
    grids: object
    margins: list[float]
    rules: OccupancyRules
    joint_poses: np.ndarray | None = None
    occupied: dict[int, Belief] = field(default_factory=dict)
    camera_m: dict[int, np.ndarray] = field(default_factory=dict)

    def is_background(self, point, depth: float, sigma: float, camera_z: float) -> bool:
        slope = abs(camera_z - point[2]) / depth
        if point[2] - self.table_z_m < min(max(self.sigmas, self.plane_sigmas * slope) * sigma, LARGEST_BOUND_M):
            return True
        if self.grid.cells_of(np.array([point]))[0] < 0:
            return False
        bound = min(self.sigmas * sigma, LARGEST_BOUND_M)
        return any(distance_to_solid(s, point) < bound for s in self.solids)

    def near_arm(self, point, bound: float) -> bool:
        for b, margin in enumerate(self.margins):
            if distance_to_body(self.grids, self.joint_poses, b, point) < min(margin + bound, LARGEST_DISTANCE_M):
                return True
        return False

    def fuse(self, exposures: list[Exposure], now_s: float) -> np.ndarray:
        touched = self._hits(exposures, now_s)
        for cell in list(self.occupied):
            if cell not in touched:
                self._miss(cell, exposures, now_s)
        return np.array(sorted({*self.occupied, *self._shadows(exposures)}), dtype=np.int32)

    def _hits(self, exposures: list[Exposure], now_s: float) -> set[int]:
        counts: dict[int, list[int]] = {}
        for e in exposures:
            view = e.view
            self.camera_m[e.camera] = view.translation
            for point in e.points_m.astype(np.float64):
                cell = int(self.grid.cells_of(point[None])[0])
                if cell < 0:
                    continue
                depth = float(view.rotation[:, 2] @ (point - view.translation))
                sigma = view.optics.sigma_per_m2 * depth**2
                if not self.is_background(point, depth, sigma, view.translation[2]) and not self.near_arm(point, self.sigmas * sigma):
                    counts.setdefault(cell, []).append(view.bit)
        for cell, bits in counts.items():
            if len(bits) >= self.rules.min_points:
                self.occupied[cell] = Belief(int(np.bitwise_or.reduce(bits)), 0, now_s)
        return set(counts)

    def _miss(self, cell: int, exposures: list[Exposure], now_s: float) -> None:
        belief = self.occupied[cell]
        verdict = max((self.look(cell, e) for e in exposures), default=OUT_OF_VIEW)
        if verdict != OUT_OF_VIEW:
            belief.in_view_s = now_s
        if verdict == SEEN_THROUGH or (exposures and self.near_arm(self.centre(cell), 0.0)):
            belief.misses += self.rules.strong_miss
        elif verdict == PROBABLY_FREE:
            belief.misses += self.rules.weak_miss
        if belief.misses >= self.rules.clear_at or now_s - belief.in_view_s > self.rules.unseen_decay_s:
            del self.occupied[cell]

    def look(self, cell: int, e: Exposure) -> int:
        view, optics = e.view, e.view.optics
        p = view.rotation.T @ (self.centre(cell) - view.translation)
        if p[2] < optics.min_range_m:
            return OUT_OF_VIEW
        u = math.floor(p[0] / p[2] * optics.fx_px + optics.cx_px + 0.5)
        v = math.floor(p[1] / p[2] * optics.fy_px + optics.cy_px + 0.5)
        height, width = view.depth_mm.shape
        if not (0 <= u < width and 0 <= v < height):
            return OUT_OF_VIEW
        measured = view.depth_mm[v, u] * 0.001
        if measured == 0:
            around = view.depth_mm[max(0, v - 1) : v + 2, max(0, u - 1) : u + 2]
            if not around.any():
                return PROBABLY_FREE
            measured = around[around > 0].min() * 0.001
        gap, half = measured - p[2], self.grid.resolution_m * math.sqrt(3) / 2
        sigma = optics.sigma_per_m2 * measured**2
        if gap <= 0:
            return NO_EVIDENCE
        if gap > half + self.sigmas * sigma:
            return SEEN_THROUGH
        ray = np.array([(u - optics.cx_px) / optics.fx_px, (v - optics.cy_px) / optics.fy_px, 1.0])
        surface = view.rotation @ (ray * measured) + view.translation
        if self.is_background(surface, measured, sigma, view.translation[2]):
            return SEEN_THROUGH
        return PROBABLY_FREE if gap > half or self.near_arm(surface, self.sigmas * sigma) else NO_EVIDENCE

    def _shadows(self, exposures: list[Exposure]) -> set[int]:
        step, out = self.grid.resolution_m / 2, set()
        for cell, belief in self.occupied.items():
            centre = self.centre(cell)
            for camera, place in self.camera_m.items():
                if not belief.cameras >> camera & 1:
                    continue
                away = (centre - place) / np.linalg.norm(centre - place)
                for s in range(1, int(self.rules.shadow_depth_m / step + 0.5) + 1):
                    behind = int(self.grid.cells_of((centre + away * step * s)[None])[0])
                    if behind < 0:
                        break
                    if behind not in self.occupied:
                        out.add(behind)
        bound = self.grid.resolution_m * math.sqrt(3) / 2
        return {
            c
            for c in out
            if all(self.look(c, e) < PROBABLY_FREE for e in exposures) and not (exposures and self.near_arm(self.centre(c), bound))
        }

    def centre(self, cell: int) -> np.ndarray:
        return self.grid.centres(np.array([cell]))[0]
