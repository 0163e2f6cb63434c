"""The planner's section of the cell config."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

from msgspec import Meta, field

from common.config import Strict
from services.planner.offline.config import (
    ExtendConfig,
    GammaSomConfig,
    MapConfig,
    MotionsConfig,
    PracticeConfig,
    ProblemsConfig,
    SomConfig,
)

__all__ = [
    "MOST_SEARCHES",
    "ClearanceConfig",
    "FallbackConfig",
    "LearningConfig",
    "MarginsConfig",
    "PlannerConfig",
    "RepairConfig",
    "ReplanConfig",
    "SeparationConfig",
    "SmoothingConfig",
    "SpeedConfig",
]

Positive = Annotated[float, Meta(gt=0)]
Length = Annotated[float, Meta(ge=0, le=0.2)]
Share = Annotated[float, Meta(gt=0, le=1)]
Way = Literal["map", "repair", "fallback"]


class MarginsConfig(Strict, frozen=True):
    """Distances that the one check keeps, in metres."""

    safety_m: Length = 0.02  # paper: arm parts are inflated by a safety distance; 2 cm is the default
    static_m: Length = 0.01  # our choice: the reference is tracked to 0.02 rad, a few millimetres at the tool
    self_m: Length = 0.005  # our choice
    step_m: Annotated[float, Meta(gt=0, le=0.1)] = 0.02  # no part of the arm moves farther between two checked poses, so none is ever
    # farther than half of it from a checked one: half of the safety distance is left in between
    # The same between two samples of an edge in the table; absent: as step_m. What a table overlooks the look at the curve finds.
    table_step_m: Annotated[float, Meta(gt=0, le=0.1)] | None = None

    @property
    def edge_step_m(self) -> float:
        """Farthest that any point of the arm moves between two samples of an edge."""
        return self.step_m if self.table_step_m is None else self.table_step_m


class ClearanceConfig(Strict, frozen=True):
    """Layers of the table beyond the safety distance, and what nearness costs a path."""

    # Issue: for example +2, +5, +10 cm; [] builds none. At most 16: our choice.
    layers_m: Annotated[list[Annotated[float, Meta(gt=0, le=0.3)]], Meta(max_length=16)] = field(default_factory=lambda: [0.02, 0.05, 0.10])
    block_m: Annotated[float, Meta(gt=0, le=0.2)] = 0.04  # edge of the blocks of cells that layers are of: two cells; our choice
    # An edge in the band of the first layer costs so much more of its length, one in the others less: a detour that long is taken to
    # get out of it. Our choice.
    weight: Annotated[float, Meta(ge=0, le=10)] = 0.25

    def __post_init__(self) -> None:
        if any(low >= high for low, high in pairwise(self.layers_m)):
            raise ValueError(f"layers_m {self.layers_m} must ascend")

    @property
    def surcharges(self) -> list[float]:
        """By band, the share by which an edge in it costs more: ``weight`` at the safety distance, less with distance, 0 beyond all layers.

        A band counts by its inner side: one that begins at d of D metres costs weight (1 - d / D).
        """
        return [self.weight * (1.0 - inner_m / self.layers_m[-1]) for inner_m in [0.0, *self.layers_m[:-1]]] if self.layers_m else []


class SeparationConfig(Strict, frozen=True):
    """How fast a part of the arm may be at a separation from what is seen: speed and separation monitoring (ISO/TS 15066, 5.5.4).

    The separation S must leave room for S_h = v_h (T_r + T_s), the way of a person until the arm stands, S_r = v_r T_r, the arm's way
    until it reacts, and S_s = v_r^2 / (2 a), its braking distance, T_s = v_r / a being the time that takes. So v_r is the largest speed
    with S_h + S_r + S_s <= S. For cells that may belong to something that moves, T_r and v_h are ``replan.hand_seen_s`` and
    ``replan.hand_speed_m_s``. For what has stood for two seconds both are zero: there is nothing to react to, so it is passed no faster
    than the arm could brake before it. The standard's intrusion distance and uncertainties C, Z_d and Z_r are in S already: it is a lower
    bound of the distance to whole cells.
    """

    slow: bool = True
    reduced_speed_m_s: Annotated[float, Meta(gt=0)] = 0.25  # ISO 10218-1, reduced speed: so fast is safe at any separation
    braking_m_s2: Annotated[float, Meta(gt=0)] = 2.5  # our choice: 5 rad/s^2 half a metre from the joint


class SmoothingConfig(Strict, frozen=True):
    """How a path becomes a motion."""

    smooth: bool = True
    # Straight segments tried to cut corners. Measured (task, off_task): with 20 motions take 6 to 8 % less time than with 10, and answers
    # as long, since a shorter way is rounded and timed sooner; 24 bring no more.
    shortcut_checks: Annotated[int, Meta(ge=0, le=200)] = 20
    # The same for the second, refined answer of an arm that stands; 0: there is none. Measured on 261 questions (task, seed 3): 150 make
    # ways shorter by 0.074 on average and take 14 ms at p99, 80 by 0.073 and 9 ms, 60 by 0.068 and 8 ms.
    refine_looks: Annotated[int, Meta(ge=0, le=2000)] = 80


class SpeedConfig(Strict, frozen=True):
    """Shares of the arm's limits that planned motions use."""

    velocity: Share = 0.8  # our choice: a person shares the table
    acceleration: Share = 0.9  # our choice: room for braking along the path, whose curvature uses acceleration too


class ReplanConfig(Strict, frozen=True):
    """When a new way is taken."""

    tick_s: Positive = 0.3  # paper, section IV: every 0.3 s
    shorter_share: Share = 0.05  # our choice, design table: shorter means by max(5 %, 0.1 rad) ...
    shorter_rad: Positive = 0.1
    shorter_stable_s: Positive = 1.0  # ... along the same corridor for 1.0 s
    corridor_rad: Positive = 0.6  # our choice: two ways are the same corridor if their middles are nearer than that
    splice_budget_s: Positive = 0.06  # a new motion leaves the running one so much later; measured: p99 of an answer is below
    stop_margin_s: Positive = 0.1  # our choice: the arm stands so long before it would reach the first blocked point
    hand_speed_m_s: Positive = 0.25  # issue: hands move at 0.25 m/s
    # At the least; slower frames and answers count as they are. A frame of 15 Hz is waited for up to 67 ms, seen and answered
    # in 70 ms (p95).
    hand_seen_s: Positive = 0.15  # measured
    stale_s: Positive = 0.4  # our choice: six frames of 15 Hz; older eyes plan nothing
    unavoidable_frames: Annotated[int, Meta(ge=1)] = 5  # our choice: evidence for something in cells that no path avoids


MOST_SEARCHES = 16  # a bound against slips; our choice


class RepairConfig(Strict, frozen=True):
    """Bounds of the search that joins the parts of the map. Counts, never time, so that equal questions get equal answers."""

    # Samples of each search. Measured of one (task and wall, 25 that the map lacks): where they are of use, 8 to 5 500 and 0.02 to 0.3 s,
    # one 9 800 and 0.4 s; 0.4 s where not, while the fallback searches too.
    iterations: Annotated[int, Meta(ge=1, le=1_000_000)] = 10_000
    # Samples of each search in a step of the planner, which takes 5 ms at the 99th percentile, 8 at most (measured, two searches).
    slice_iterations: Annotated[int, Meta(ge=1, le=1_000)] = 50
    connections: Annotated[int, Meta(ge=1, le=1_000)] = 64  # nearest neurons that start and goal may join; our choice
    # Side by side, on samples of their own, until the fallback is asked; the first way that one finds is taken. Two: as a small laptop has.
    searches: Annotated[int, Meta(ge=1, le=MOST_SEARCHES)] = 2


class FallbackConfig(Strict, frozen=True):
    """Bounds of the search in the whole joint space, in a process of its own."""

    # Samples of each search; 5 to 8 s where there is no way. Measured, of one search, 10 generators each: the narrowest of 462 questions
    # needs 11 000 to 81 000, the next ones 5 000 to 34 000.
    iterations: Annotated[int, Meta(ge=1, le=10_000_000)] = 120_000
    # Side by side, with so many samples each, and each on a core of its own while no one else wants it; every second knows the map.
    # Two: as a small laptop has.
    searches: Annotated[int, Meta(ge=1, le=MOST_SEARCHES)] = 2


class LearningConfig(Strict, frozen=True):
    """What ``planner/learn``, repair and fallback may do to the running map."""

    from_ways: bool = True  # what repair and fallback solved is learned too

    keep: bool = True  # in the cache, beside the map, so that the next start knows it
    max_added_neurons: Annotated[int, Meta(ge=0, le=200_000)] = 5_000  # in all, earlier starts too; our choice: half of the paper's map
    max_samples: Annotated[int, Meta(ge=2)] = 20_000  # of one path; our choice: 160 s of robot/state
    reuse_share: Annotated[float, Meta(ge=0, le=1)] = 0.5  # of the map's usual spacing: so near a neuron stands for a point; ours
    join_neighbours: Annotated[int, Meta(ge=0, le=50)] = 5  # as map.join_neighbours
    join_max_rad: Positive = 1.0  # as map.bridge_max_rad
    max_waiting: Annotated[int, Meta(ge=1)] = 8  # motions; more are answered "busy"; our choice


class PlannerConfig(Strict, frozen=True):
    """Section ``[planner]``."""

    motions: MotionsConfig
    map: MapConfig = MapConfig()
    practice: PracticeConfig = PracticeConfig()
    som: SomConfig = SomConfig()
    gamma_som: GammaSomConfig = GammaSomConfig()
    extend: ExtendConfig = ExtendConfig()
    problems: ProblemsConfig = ProblemsConfig()
    margins: MarginsConfig = MarginsConfig()
    clearance: ClearanceConfig = ClearanceConfig()
    separation: SeparationConfig = SeparationConfig()
    smoothing: SmoothingConfig = SmoothingConfig()
    speed: SpeedConfig = SpeedConfig()
    replan: ReplanConfig = ReplanConfig()
    # Asked in this order; without one of the last two that one is left out. Taking paths of the map alone is the paper's way.
    ways: tuple[Way, ...] = ("map", "repair", "fallback")
    repair: RepairConfig = RepairConfig()
    fallback: FallbackConfig = FallbackConfig()
    learning: LearningConfig = LearningConfig()
    taught: list[str] = []  # files of `tolman teach` that the map is trained on too; absolute, or as seen from where tolman is started
    model: Literal["gng", "som", "gamma_som"] = "gng"  # paper: gng has the shortest paths; parameters in map, som, gamma_som
    rules: Literal["checked", "paper"] = "checked"
    # The paper has Dijkstra and wavefront; A* finds ways of the same cost several times faster.
    search: Literal["dijkstra", "astar", "bidirectional", "wavefront"] = "astar"

    def __post_init__(self) -> None:
        if "map" not in self.ways:
            raise ValueError(f"ways: {list(self.ways)} without map; the map is always asked first")
