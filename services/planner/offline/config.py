"""The offline half of the planner's section: ``[planner.motions]`` and ``[planner.map]``."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from common.config import Strict

__all__ = ["MapConfig", "MotionsConfig", "RegionConfig"]

Fraction = Annotated[float, Meta(ge=0, le=1)]
Positive = Annotated[float, Meta(gt=0)]
Count = Annotated[int, Meta(ge=1)]
Seed = Annotated[int, Meta(ge=0)]
Vector3 = Annotated[list[float], Meta(min_length=3, max_length=3)]


class RegionConfig(Strict, frozen=True):
    """Where the tool reaches: a box of tool positions in the world; the tool points down, turned about the vertical, tilted a little."""

    min_m: Vector3
    max_m: Vector3
    turn_max_rad: Annotated[float, Meta(ge=0, le=3.1416)] = 3.1416  # either way; half of it serves a gripper that is the same half turned
    tilt_max_rad: Annotated[float, Meta(ge=0, le=1.5)] = 0.3  # our choice: a gripper leans to get past a bin's wall

    def __post_init__(self) -> None:
        if any(low > high for low, high in zip(self.min_m, self.max_m, strict=True)):
            raise ValueError(f"min_m {self.min_m} must not exceed max_m {self.max_m}")


class MotionsConfig(Strict, frozen=True):
    """The training data: reaching motions of pick and place, some of them among random boxes."""

    pick: RegionConfig
    place: RegionConfig
    n_trajectories: Count = 1230  # paper
    n_samples: Count = 50_000  # paper: 50 728; the motions are resampled at equal steps to at least that many
    seed: Seed = 0
    cluttered: Fraction = 0.5  # issue: half of them; measured: share of questions solved 0.77 -> 0.94
    boxes_max: Count = 4  # our choice: 1 to 4 boxes a scene
    box_min_m: Positive = 0.06  # our choice: from a hand ...
    box_max_m: Positive = 0.25  # ... to a forearm or a crate
    n_workers: Count = 2  # processes; does not change the result


class MapConfig(Strict, frozen=True):
    """The growing neural gas, and what is done to it until it is a map."""

    n_neurons: Annotated[int, Meta(ge=4, le=60_000)] = 10_000  # paper; the table counts neurons in uint16
    seed: Seed = 0
    insert_every: Count = 100  # lambda; Fritzke 1995
    e_best: Fraction = 0.1  # measured: 0.2 of 1995 leaves the units trembling by a third of their spacing
    e_neighbour: Fraction = 0.006  # Fritzke 1995
    alpha: Fraction = 0.5  # Fritzke 1995
    decay: Fraction = 0.9995  # a signal; 0.995 of 1995 forgets all but 200 signals, 10 000 units win once in 10 000
    max_age: Count = 50  # Fritzke 1995
    bridge_max_rad: Positive = 1.0  # our choice: longest edge that may join two components
    join_neighbours: Count = 5  # near the mean degree of the gas; edges tried for a neuron added after pruning
