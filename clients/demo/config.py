"""The section ``[demo]`` of a cell config: where the arm works, and what comes in its way."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from common.config import Strict

__all__ = ["BoxesConfig", "DemoConfig", "HandConfig", "RangeM"]

Positive = Annotated[float, Meta(gt=0)]
RangeS = tuple[Positive, Positive]
RangeM = tuple[float, float]


class RegionConfig(Strict, frozen=True):
    """A box of tool positions in the world; the tool points down there, turned about the vertical by ``turn_max_rad`` at most."""

    min_m: tuple[float, float, float]
    max_m: tuple[float, float, float]
    turn_max_rad: float = 3.1416


class HandConfig(Strict, frozen=True):
    """A forearm with a hand that reaches in from the far side, along -x, rests, and leaves the way it came."""

    enter_x_m: float = 0.95  # our choice: where the tip waits, beyond the grid
    reach_x_m: RangeM = (0.30, 0.42)  # where the tip rests: between the bins, which stand at x = 0.32
    y_m: RangeM = (-0.10, 0.10)
    z_m: RangeM = (0.14, 0.32)
    speed_m_s: Positive = 0.25  # issue 2
    rest_s: RangeS = (0.8, 2.0)  # our choice
    pause_s: RangeS = (2.0, 4.0)  # our choice: between two visits
    forearm_radius_m: Positive = 0.04  # an adult's; our choice
    forearm_length_m: Positive = 0.30
    hand_size_m: tuple[Positive, Positive, Positive] = (0.18, 0.09, 0.04)  # length, breadth, thickness of an adult's; our choice


class BoxesConfig(Strict, frozen=True):
    """Boxes that appear in the arm's way and vanish again."""

    x_m: RangeM = (0.22, 0.45)
    y_m: RangeM = (-0.12, 0.12)
    z_m: RangeM = (0.06, 0.40)
    edge_m: RangeM = (0.06, 0.14)
    life_s: RangeS = (2.5, 5.0)
    pause_s: RangeS = (3.0, 6.0)
    clearance_m: Positive = 0.10  # issue 2: none appears within 10 cm of the arm ...
    horizon_s: Positive = 0.5  # ... nor of where the arm will be before it could stand (v/a_max + detection); our choice


class DemoConfig(Strict, frozen=True):
    """Everything that the demo's script is drawn from."""

    pick: RegionConfig
    place: RegionConfig
    goal_patience_s: Positive = 30.0  # our choice: then the next goal is tried
    settle_s: Positive = 1.0  # our choice: calm before the first obstacle
    hand: HandConfig = HandConfig()
    boxes: BoxesConfig = BoxesConfig()
