"""How large each experiment of the report is: the full run, and the quick one that CI repeats on small maps."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from common.config import Strict

__all__ = ["FULL", "QUICK", "Scale"]

Count = Annotated[int, Meta(ge=1)]


class Scale(Strict, frozen=True):
    """Numbers of neurons, runs and scenes. What is not marked otherwise is our choice, bounded by 45 min on two cores (issue)."""

    name: str
    lattice_side: Count  # paper: 100 x 100 neurons
    gamma_epochs: Count  # see GammaSomParameters
    overrides: list[str]  # of the cell config: the map's size and its training data
    n_runs: Count  # paper: 20 runs of one question
    n_scenes: Count  # scenes behind every comparison that is not about one question
    n_share_scenes: Count  # as `tolman bench replan` asks
    n_big_scenes: Count  # issue: 200 scenes with growing obstacles
    network_sizes: list[Count]  # issue: 1k, 2k, 5k, 10k, 20k
    n_size_scenes: Count  # questions asked to each network size
    n_clutter_scenes: Count  # scenes for each number of boxes
    clutter_boxes: list[Count]  # issue: 1 to 8 boxes
    gaps_m: list[float]  # issue: a gap of 8 to 30 cm
    n_gap_tries: Count  # start poses for each gap
    peer_limit_s: float  # a sampling planner that takes longer counts as failed
    solvable_limit_s: float  # a question that RRTConnect does not solve in so long counts as not solvable
    n_sampler_paths: Count  # runs of each sampling planner that are drawn
    n_constraint_motions: Count  # taught motions that keep the tool's orientation
    constraint_neurons: Count
    n_plans: Count  # issue: tool tilt along 100 plans
    extend_neurons: Count  # of the general map, and again as many for the task
    n_extend_scenes: Count
    dodge_s: float  # seconds of the running stack that are watched for a dodge


FULL = Scale(
    name="full",
    lattice_side=100,
    gamma_epochs=40,
    overrides=[],
    n_runs=20,
    n_scenes=40,
    n_share_scenes=500,
    n_big_scenes=200,
    network_sizes=[1000, 2000, 5000, 10_000, 20_000],
    n_size_scenes=100,
    n_clutter_scenes=25,
    clutter_boxes=[1, 2, 3, 4, 5, 6, 7, 8],
    gaps_m=[0.08, 0.10, 0.12, 0.14, 0.16, 0.20, 0.24, 0.30],
    n_gap_tries=20,
    peer_limit_s=2.0,
    solvable_limit_s=5.0,  # issue
    n_sampler_paths=8,
    n_constraint_motions=400,
    constraint_neurons=5000,
    n_plans=100,
    extend_neurons=5000,
    n_extend_scenes=200,
    dodge_s=60.0,
)

QUICK = Scale(
    name="quick",
    lattice_side=28,
    gamma_epochs=6,
    overrides=["planner.map.n_neurons=800", "planner.motions.n_trajectories=120", "planner.motions.n_samples=6000"],
    n_runs=3,
    n_scenes=2,
    n_share_scenes=6,
    n_big_scenes=6,
    network_sizes=[200, 400],
    n_size_scenes=6,
    n_clutter_scenes=2,
    clutter_boxes=[1, 8],
    gaps_m=[0.08, 0.30],
    n_gap_tries=2,
    peer_limit_s=0.5,
    solvable_limit_s=0.5,
    n_sampler_paths=2,
    n_constraint_motions=20,
    constraint_neurons=300,
    n_plans=5,
    extend_neurons=300,
    n_extend_scenes=5,
    dodge_s=15.0,
)
