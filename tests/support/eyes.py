"""Cameras and perception in one process, without bus and clock: render, add noise, fuse. For tests and measurements."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from common.cell import load
from common.geometry.grid import Grid
from common.geometry.transforms import invert
from common.robot.model import load_robot
from services.perception.adapters.back_projection import back_project
from services.perception.config import PerceptionConfig
from services.perception.core.arm import arm_at
from services.perception.core.background import background_of
from services.perception.core.camera_view import CameraView, Optics, sigma_per_m2
from services.perception.core.occupancy import Exposure, Occupancy
from services.robot_sim.adapters.raycast import DepthRenderer
from services.robot_sim.cameras.config import CamerasConfig
from services.robot_sim.core.camera_noise import DepthNoise
from services.robot_sim.core.camera_shapes import PlacedShape

F64 = NDArray[np.float64]


class Eyes:
    """The UR3 cell seen by its four cameras.

    Args:
        overrides: ``--set`` strings.
        seed: of the noise.
        perfect: no noise and no dropouts.
    """

    def __init__(self, overrides: list[str] | None = None, *, seed: int = 0, perfect: bool = False) -> None:
        overrides = list(overrides or [])
        if perfect:
            overrides += ["cameras.noise.disparity_sigma_px=0.0", "cameras.noise.edge_dropout=0.0"]
        self.cell, self.cameras_config = load(None, "cameras", CamerasConfig, overrides)
        _, self.config = load(None, "perception", PerceptionConfig, overrides)
        self.robot = load_robot(self.cell.robot)
        self.models = self.cameras_config.models()
        self.grid = Grid.of(self.cell.grid)
        home = self.robot.joint_poses(self.robot.home_rad[None])[0]
        self.renderer = DepthRenderer(self.models, self.robot.bodies, home[0], self.cell.static)
        self.noise = DepthNoise(self.cameras_config.noise_model(), seed)
        self.background = background_of(self.grid, self.cell.table_z_m, self.cell.static, self.config.sigmas, self.config.plane_sigmas)
        self.margin = np.full(len(self.robot.bodies), self.config.self_margin_m)
        self.ms: dict[str, list[float]] = {}
        self.forget()

    def forget(self) -> None:
        """Start with nothing seen."""
        self.occupancy = Occupancy(self.grid, self.background, self.robot.grids, self.config.rules())
        self.frame = 0

    def depth_images(self, q_rad: F64, shapes: Sequence[PlacedShape]) -> list[NDArray[np.uint16]]:
        """What the four cameras measure."""
        images = self.renderer.render(self.robot.joint_poses(np.asarray(q_rad, dtype=np.float64)[None])[0], shapes)
        return [self.noise.measure(image, m.fx_px, i, self.frame) for i, (image, m) in enumerate(zip(images, self.models, strict=True))]

    def exposures(self, q_rad: F64, images: Sequence[NDArray[np.uint16]], missing: Sequence[int] = ()) -> list[Exposure]:
        """The exposures of a set."""
        out = []
        for i, (m, depth) in enumerate(zip(self.models, images, strict=True)):
            if i in missing:
                continue
            points = back_project(depth, m.fx_px, m.fy_px, m.cx_px, m.cy_px, invert(m.T_world_camera), self.config.max_range_m)
            sigma = sigma_per_m2(self.config.disparity_sigma_px, m.fx_px, self.config.baseline_m)
            optics = Optics(m.fx_px, m.fy_px, m.cx_px, m.cy_px, sigma, self.config.min_range_m)
            R, t = np.ascontiguousarray(m.T_world_camera[:3, :3]), np.ascontiguousarray(m.T_world_camera[:3, 3])
            view = CameraView(optics, R, t, 1 << i, depth)
            out.append(Exposure(i, view, points, arm_at(self.robot.chain, self.robot.grids, q_rad, self.margin, self.config.sigmas)))
        return out

    def look(
        self, q_rad: F64, shapes: Sequence[PlacedShape] = (), *, q_filter_rad: F64 | None = None, missing: Sequence[int] = ()
    ) -> NDArray[np.int32]:
        """One set at 15 Hz: occupied cells after it. ``q_filter_rad``: where perception believes the arm to be (default: the truth)."""
        images = self.depth_images(q_rad, shapes)
        started = time.perf_counter()
        exposures = self.exposures(q_rad if q_filter_rad is None else q_filter_rad, images, missing)
        self.ms.setdefault("project", []).append((time.perf_counter() - started) * 1e3)
        cells = self.fuse(exposures, self.frame / 15.0)
        self.ms.setdefault("total", []).append((time.perf_counter() - started) * 1e3)
        self.frame += 1
        return cells

    def fuse(self, exposures: Sequence[Exposure], now_s: float) -> NDArray[np.int32]:
        """Occupied cells after a set; the shadows among them are kept in ``shadow_cells``."""
        t = [time.perf_counter()]
        self.occupancy.begin()
        for exposure in exposures:
            self.occupancy.splat(exposure)
        t.append(time.perf_counter())
        self.occupancy.settle(exposures, now_s)
        t.append(time.perf_counter())
        self.shadow_cells = self.occupancy.shadows(exposures)
        cells = self.occupancy.cells(self.shadow_cells)
        t.append(time.perf_counter())
        for name, a, b in zip(("splat", "settle", "shadows"), t[:-1], t[1:], strict=True):
            self.ms.setdefault(name, []).append((b - a) * 1e3)
        return cells
