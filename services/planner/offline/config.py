"""The offline half of the planner's section: ``[planner.motions]``, and one section for each model of the map."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from common.config import Strict

__all__ = ["ExtendConfig", "GammaSomConfig", "MapConfig", "MotionsConfig", "PracticeConfig", "ProblemsConfig", "RegionConfig", "SomConfig"]

Fraction = Annotated[float, Meta(ge=0, le=1)]
Positive = Annotated[float, Meta(gt=0)]
Count = Annotated[int, Meta(ge=1)]
Seed = Annotated[int, Meta(ge=0)]
Side = Annotated[int, Meta(ge=1, le=1000)]  # units along one side of a lattice
Rate = Annotated[float, Meta(gt=0, le=1)]
MOST_NEURONS = 200_000  # our choice: twice the largest map that was measured; its table has about 2 GB
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


class ProblemsConfig(Strict, frozen=True):
    """``[planner.problems]``: how problems of a file are planned, and what motions their map is made from. Only then is any of it used."""

    gripper_m: tuple[Positive, Positive, Positive] = (0.10, 0.06, 0.14)  # issue: a box on the flange, its length along the flange's z
    resolution_m: Annotated[float, Meta(gt=0, le=0.1)] = 0.02  # issue; by option 0.01
    # Issue: at most 5 mm, so that no margin deletes the hard ones. Measured: start and goal are free of 2 cm cells in 0.91 of problems with
    # 1 mm, in 0.93 with 0.5 mm; with voxels of 5 mm in 0.89 and 0.90.
    safety_m: Annotated[float, Meta(ge=0, le=0.005)] = 0.0005
    voxel_m: Annotated[float, Meta(ge=0.001, le=0.01)] = 0.0025  # of the arm's distance grids, whose rounding is an inflation too
    step_m: Annotated[float, Meta(gt=0, le=0.01)] = 0.001  # no point is farther than half of it from a checked pose: the safety distance
    table_step_m: Annotated[float, Meta(gt=0, le=0.1)] = 0.015  # our choice: a table in a quarter of the time that step_m would take
    self_m: Annotated[float, Meta(ge=0, le=0.005)] = 0.0  # the spheres that are checked stick out as it is; our choice
    clearance_m: Annotated[float, Meta(ge=0, le=0.1)] = 0.0  # kept by training motions from the true shapes, besides what spheres stick out
    n_neurons: Annotated[int, Meta(ge=4, le=MOST_NEURONS)] = 10_000  # paper
    n_samples: Count = 50_000  # paper: 50 728
    motions_per_problem: Count = 12  # RRTConnect's, each from its own seed
    random_share: Fraction = 0.67  # of them in the problem's scene moved at random, the others in the scene as it is
    turn_max_rad: Annotated[float, Meta(ge=0, le=3.1416)] = 0.5  # either way about the first joint's axis; our choice
    shift_max_m: Annotated[float, Meta(ge=0, le=1)] = 0.1  # either way along each axis; our choice
    seed: Seed = 0
    n_workers: Count = 2  # processes; does not change the result


class MapConfig(Strict, frozen=True):
    """``[planner.map]``: the growing neural gas (model ``gng``), and what is done to it until it is a map."""

    n_neurons: Annotated[int, Meta(ge=4, le=MOST_NEURONS)] = 10_000  # paper
    seed: Seed = 0
    insert_every: Count = 100  # lambda; Fritzke 1995
    e_best: Fraction = 0.1  # measured: 0.2 of 1995 leaves the units trembling by a third of their spacing
    e_neighbour: Fraction = 0.006  # Fritzke 1995
    alpha: Fraction = 0.5  # Fritzke 1995
    decay: Fraction = 0.9995  # a signal; 0.995 of 1995 forgets all but 200 signals, 10 000 units win once in 10 000
    max_age: Count = 50  # Fritzke 1995
    bridge_max_rad: Positive = 1.0  # our choice: longest edge that may join two components
    join_neighbours: Count = 5  # near the mean degree of the gas; edges tried for a neuron added after pruning
    # Two neurons that are among each other's nearest get an edge if the way over the map is so many times longer than the straight line;
    # 0 neighbours: none do. Measured, see services.planner.offline.cycles; Nieuwenhuisen and Overmars 2004 have no value for joint space.
    cycle_neighbours: Annotated[int, Meta(ge=0, le=200)] = 32
    cycle_stretch: Annotated[float, Meta(ge=1)] = 4.0


class PracticeConfig(Strict, frozen=True):
    """``[planner.practice]``: ways that a gas lacks when it is asked become part of it (:mod:`services.planner.offline.practice`)."""

    share: Annotated[float, Meta(ge=0, le=0.5)] = 0.1  # of the map's neurons; 0: none, the gas alone
    # Asked for each neuron of the map, at most. Measured with 10 000 neurons, unseen questions solved by the map, of 1 500: 1 348 with 0.3,
    # 1 346 with 0.4, 1 351 with 0.5, when there is no room left; with 0.6, a share of 0.15 and 2 000 samples 1 354, a build of 98
    # instead of 83 s. A few more or less are luck: practice of the same kind with other samples 1 350 instead of 1 348.
    exercises_per_neuron: Annotated[float, Meta(ge=0, le=10)] = 0.5
    # Samples of repair for each. Measured in the same way (before islands were kept): 1 334 with 400, 1 341 with 1 000.
    iterations: Count = 1_000
    step_rad: Positive = 0.5  # longest piece between two neurons of a way beside the map; our choice, about the median edge
    seed: Seed = 0


class SomConfig(Strict, frozen=True):
    """``[planner.som]``: Kohonen's map (model ``som``). Radii in steps of the lattice.

    A schedule that is left out follows the SOM Toolbox's rule for the lattice and the number of samples, see
    :meth:`services.planner.core.som.SomParameters.of`; for 100 x 100 units and 50 000 samples it gives the values in the comments.
    """

    rows: Side = 100  # paper
    columns: Side = 100  # paper
    n_neighbours: Literal[4, 8] = 8  # measured: topographic error 0.06 against 0.15, and ways along diagonals are shorter
    seed: Seed = 0  # sequential training only; batch draws nothing
    training: Literal["batch", "sequential"] = "batch"  # SOM Toolbox
    radius_start_steps: Positive | None = None  # 13
    radius_middle_steps: Positive | None = None  # 3.25
    radius_end_steps: Positive = 1.0  # SOM Toolbox
    epochs_rough: Count | None = None  # 2; in sequential training only the ratio of the two counts
    epochs_fine: Count | None = None  # 8
    rate_rough: Rate = 0.5  # SOM Toolbox; sequential only
    rate_fine: Rate = 0.05  # SOM Toolbox; sequential only
    signals_per_unit: Count = 500  # Kohonen 1995: at least; sequential only

    def __post_init__(self) -> None:
        _check_lattice(self.rows, self.columns)


class GammaSomConfig(Strict, frozen=True):
    """``[planner.gamma_som]``: the gamma-SOM of Estévez and Hernández 2009 (model ``gamma_som``); its own names.

    What was measured, and how, is told at :class:`services.planner.core.gamma_som.GammaSomParameters`.
    """

    rows: Side = 100  # paper
    columns: Side = 100  # paper
    n_neighbours: Literal[4, 8] = 8  # as for the SOM
    seed: Seed = 0  # of the order of the trajectories
    n_contexts: Annotated[int, Meta(ge=0, le=20)] = 2  # K; measured: 1 and 3 change little
    beta: Annotated[float, Meta(ge=0, lt=1)] = 0.7  # our choice: a memory of K / (1 - beta) = 7 samples, a sixth of a trajectory
    a_w: Rate = 0.8  # measured: the weight's share in a distance; 0.5 costs a tenth of the fineness
    epochs: Count = 40  # measured: half of them end 5 % coarser
    rate_start: Rate = 0.3  # our choice
    rate_end: Rate = 0.02  # measured: 0.05 makes the edges a quarter longer
    sigma_start_steps: Positive | None = (
        None  # left out: 0.18 of the longer side (18 of 100), as wide as the SOM's radius of 13; our choice
    )
    sigma_end_steps: Positive = 1.0  # measured: 0.7 folds the lattice (topographic error 0.22 instead of 0.14)

    def __post_init__(self) -> None:
        _check_lattice(self.rows, self.columns)


def _check_lattice(rows: int, columns: int) -> None:
    if not 4 <= rows * columns <= MOST_NEURONS:
        raise ValueError(f"rows x columns must be 4 to {MOST_NEURONS} units, got {rows} x {columns}")


class ExtendConfig(Strict, frozen=True):
    """``[planner.extend]``: what a trained gas learns when further motions are shown to it. No part of a map that is not extended."""

    motions: list[str] = []  # files, as planner.taught; the map is the kept gas, extended by them. Empty: the map as it was trained
    # neurons it may grow by: a tenth of the map. Measured with 120 motions between two other bins: their quantisation error falls from
    # 0.775 to 0.111 rad (0: 0.303, 500: 0.165, 2000: 0.069), that of the motions it knew grows from 0.204 to 0.232 rad
    n_added: Annotated[int, Meta(ge=0, le=MOST_NEURONS)] = 1000
    rounds: Count = 4  # times that it sees as many signals as there are new samples, more where it has to grow; our choice
    seed: Seed = 0
