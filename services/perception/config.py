"""Section ``[perception]`` of a cell config."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

from common.config import Strict
from services.perception.core.occupancy import OccupancyRules

__all__ = ["PerceptionConfig"]

Positive = Annotated[float, Meta(gt=0)]
NotNegative = Annotated[float, Meta(ge=0)]
Count = Annotated[int, Meta(ge=1, le=255)]


class PerceptionConfig(Strict, frozen=True, kw_only=True):
    """What the eyes believe. Numbers that an operator tunes are in the file, the algorithm's constants are defaults here."""

    cameras: Annotated[list[str], Meta(min_length=1, max_length=8)]
    disparity_sigma_px: NotNegative
    baseline_m: Positive
    min_range_m: Positive
    max_range_m: Positive
    min_points: Count
    self_margin_m: NotNegative
    self_margin_of_body_m: dict[str, NotNegative] = msgspec.field(default_factory=dict)
    shadow_depth_m: NotNegative
    set_deadline_s: Positive
    max_age_s: Positive
    unseen_decay_s: Positive

    set_tolerance_s: Positive = 0.010  # exposures this close belong to one set; well below half a frame period at 30 Hz; our choice
    missing_after_s: Positive = 0.5  # a camera silent for seven frames is reported; our choice
    sigmas: Positive = 3.0  # design: points within 3 sigma(z) of table, wall or arm are table, wall or arm
    plane_sigmas: NotNegative = 4.0  # along the table's normal: 1e5 table points a frame would leave a false cell every few seconds at 3
    strong_miss: Count = 3  # a cell seen through is cleared by two such frames, our choice
    weak_miss: Count = 1  # no return at all, or something just behind: six frames, 0.4 s at 15 Hz; our choice
    clear_at: Count = 6

    def rules(self) -> OccupancyRules:
        """The numbers of the evidence as the core wants them."""
        return OccupancyRules(self.min_points, self.strong_miss, self.weak_miss, self.clear_at, self.unseen_decay_s, self.shadow_depth_m)
