"""Section ``[cameras]`` of a cell config."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from common.cell import Vector3
from common.config import Strict
from common.geometry.transforms import look_at
from services.robot_sim.core.camera_model import CameraModel
from services.robot_sim.core.camera_noise import NoiseModel

__all__ = ["CamerasConfig", "NoiseConfig", "ViewConfig"]

Positive = Annotated[float, Meta(gt=0)]
NotNegative = Annotated[float, Meta(ge=0)]
Share = Annotated[float, Meta(ge=0, lt=1)]
Pixels = Annotated[int, Meta(ge=8, le=2048)]


class ViewConfig(Strict, frozen=True, kw_only=True):
    """One camera: where it is and what its optical axis points at; world frame."""

    name: Annotated[str, Meta(pattern="^[a-z0-9_]+$")]
    position_m: Vector3
    look_at_m: Vector3

    def __post_init__(self) -> None:
        look_at(self.position_m, self.look_at_m)  # says so where there is no view direction


class NoiseConfig(Strict, frozen=True, kw_only=True):
    """The sensor's faults; see :mod:`services.robot_sim.core.camera_noise`."""

    disparity_sigma_px: NotNegative
    baseline_m: Positive
    edge_step: Positive
    edge_dropout: Share


class CamerasConfig(Strict, frozen=True, kw_only=True):
    """All cameras are of one kind and expose at the same instants."""

    rate_hz: Annotated[float, Meta(gt=0, le=120)]
    width: Pixels
    height: Pixels
    horizontal_fov_deg: Annotated[float, Meta(gt=1, lt=170)]
    vertical_fov_deg: Annotated[float, Meta(gt=1, lt=170)]
    min_range_m: Positive
    max_range_m: Positive
    noise: NoiseConfig
    seed: Annotated[int, Meta(ge=0)] = 0
    render_delay_s: NotNegative = 0.010  # one state period (8 ms) and its way here: then the exposure lies between two samples
    max_extrapolation_s: NotNegative = 0.1  # three scene periods; our choice
    views: Annotated[list[ViewConfig], Meta(min_length=1, max_length=16)]

    def __post_init__(self) -> None:
        names = [view.name for view in self.views]
        if len(set(names)) != len(names):
            raise ValueError(f"two cameras have the same name: {names}")
        if self.max_range_m <= self.min_range_m:
            raise ValueError(f"max_range_m {self.max_range_m} is not above min_range_m {self.min_range_m}")

    def models(self) -> list[CameraModel]:
        """The cameras as configured."""
        return [
            CameraModel.of_field_of_view(
                view.name,
                self.width,
                self.height,
                self.horizontal_fov_deg,
                self.vertical_fov_deg,
                look_at(view.position_m, view.look_at_m),
            )
            for view in self.views
        ]

    def noise_model(self) -> NoiseModel:
        """The sensor's faults as the core wants them."""
        n = self.noise
        return NoiseModel(n.disparity_sigma_px, n.baseline_m, n.edge_step, n.edge_dropout, self.min_range_m, self.max_range_m)
