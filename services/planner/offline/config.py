"""The offline half of the planner's section: ``[planner.motions]`` and ``[planner.map]``."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from common.config import Strict

__all__ = ["MapConfig", "MotionsConfig", "RegionConfig"]

Fraction = Annotated[float, Meta(ge=0, le=1)]
Positive = Annotated[float, Meta(gt=0)]
Count = Annotated[int, Meta(ge=1)]
Vector3 = Annotated[list[float], Meta(min_length=3, max_length=3)]


class RegionConfig(Strict, frozen=True):
    """Where the tool reaches: a box of tool positions in the world, the tool down, turned and tilted within bounds."""

    min_m: Vector3
    max_m: Vector3
    tilt_max_rad: Annotated[float, Meta(ge=0, le=1.5)] = 0.3  # our choice: a gripper leans to get past a bin's wall


class MotionsConfig(Strict, frozen=True):
    """The training data: reaching motions of pick and place by RRTConnect, half of them among random boxes."""

    pick: RegionConfig
    place: RegionConfig
    n_trajectories: Count = 1230  # paper
    n_samples: Count = 50_000  # paper: 50 728
    seed: Annotated[int, Meta(ge=0)] = 0


class MapConfig(Strict, frozen=True):
    """The growing neural gas and what is done to it until it is a map."""

    n_neurons: Annotated[int, Meta(ge=4, le=60_000)] = 10_000  # paper: 10 000; above 65 535 the table's uint16 would not do
    seed: Annotated[int, Meta(ge=0)] = 0
    insert_every: Count = 100  # lambda; Fritzke 1995
    e_best: Fraction = 0.1  # measured: 0.2 of 1995 leaves the units trembling by a third of their spacing
    e_neighbour: Fraction = 0.006  # Fritzke 1995
    alpha: Fraction = 0.5  # Fritzke 1995
    decay: Fraction = 0.9995  # a signal; 0.995 of 1995 forgets all but 200 signals, 10 000 units win once in 10 000
    max_age: Count = 50  # Fritzke 1995
    bridge_max_rad: Positive = 0.8  # our choice: longest edge that may join two components
    join_neighbours: Count = 4  # our choice: near the mean degree of the gas; edges tried for a neuron added after pruning
    edge_step_rad: Positive = 0.02  # our choice: with 0.75 m reach no point of the arm moves more than 1.5 cm between two checks
