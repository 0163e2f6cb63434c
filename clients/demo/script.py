"""What happens in a demo: a seed -> goals over the two bins, visits of a hand, boxes that come and go. Pure."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from clients.demo.config import BoxesConfig, DemoConfig, HandConfig, RangeM, RegionConfig
from common.wire.messages import Pose, SetGoal, SetObstacle, Waypoint

__all__ = ["Act", "Goal", "acts", "goals"]

ALONG_X_XYZW = [0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5)]  # a quarter turn about y: the capsule's z lies along x
GOAL_STREAM, HAND_STREAM, BOX_STREAM = 0, 1, 2  # each draws from its own generator, so that changing one leaves the others alone


@dataclass(frozen=True, eq=False)
class Act:
    """Obstacles that appear ``at_s`` and are gone after ``life_s``. ``is_sudden``: they must not appear where the arm is about to be."""

    at_s: float
    life_s: float
    obstacles: tuple[SetObstacle, ...]
    is_sudden: bool


@dataclass(frozen=True, eq=False)
class Goal:
    """A place to go; ``region`` is ``pick`` or ``place``."""

    region: str
    request: SetGoal


def goals(seed: int, config: DemoConfig) -> Iterator[Goal]:
    """Tool poses over the two bins in turn, for ever; the tool points down, turned about the vertical."""
    rng = np.random.default_rng([seed, GOAL_STREAM])
    while True:
        yield Goal("pick", _pose_in(config.pick, rng))
        yield Goal("place", _pose_in(config.place, rng))


def acts(seed: int, config: DemoConfig) -> Iterator[Act]:
    """Everything that comes in the way, by time, for ever."""
    hands = _hand_visits(np.random.default_rng([seed, HAND_STREAM]), config.hand, config.settle_s)
    boxes = _box_visits(np.random.default_rng([seed, BOX_STREAM]), config.boxes, config.settle_s)
    return heapq.merge(hands, boxes, key=lambda act: act.at_s)


def _draw(rng: np.random.Generator, bounds: RangeM) -> float:
    return float(rng.uniform(*bounds))


def _pose_in(region: RegionConfig, rng: np.random.Generator) -> SetGoal:
    position = [float(value) for value in rng.uniform(region.min_m, region.max_m)]
    half = _draw(rng, (-region.turn_max_rad, region.turn_max_rad)) / 2.0
    # Turn about the vertical, then half a turn about x: (0, 0, sin, cos) * (1, 0, 0, 0).
    quaternion = [math.cos(half), math.sin(half), 0.0, 0.0]
    return SetGoal(pose=Pose(position_m=position, quaternion_xyzw=quaternion))


def _hand_visits(rng: np.random.Generator, config: HandConfig, start_s: float) -> Iterator[Act]:
    at_s, number = start_s, 0
    while True:
        number += 1
        tip_m = _draw(rng, config.reach_x_m)
        y_m, z_m = _draw(rng, config.y_m), _draw(rng, config.z_m)
        rest_s = _draw(rng, config.rest_s)
        visit_s = 2.0 * (config.enter_x_m - tip_m) / config.speed_m_s + rest_s
        obstacles = _hand_with_forearm(number, config, tip_m, y_m, z_m, rest_s)
        # A hand waits for an arm that stands in its way, so it may leave later than planned: it is taken away a second after its time.
        yield Act(at_s, visit_s + 1.0, obstacles, is_sudden=False)
        at_s += visit_s + 1.0 + _draw(rng, config.pause_s)


def _hand_with_forearm(number: int, config: HandConfig, tip_m: float, y_m: float, z_m: float, rest_s: float) -> tuple[SetObstacle, ...]:
    """Two bodies that move as one: the hand ahead, the forearm behind it."""
    length_m = config.hand_size_m[0]
    forearm_behind_tip_m = length_m + config.forearm_length_m / 2.0

    def body(name: str, shape: str, size_m: list[float], behind_tip_m: float, quaternion: list[float]) -> SetObstacle:
        outside, inside = [config.enter_x_m + behind_tip_m, y_m, z_m], [tip_m + behind_tip_m, y_m, z_m]
        way = [
            Waypoint(position_m=inside, speed_m_s=config.speed_m_s, rest_s=rest_s),
            Waypoint(position_m=outside, speed_m_s=config.speed_m_s, rest_s=0.0),
        ]
        return SetObstacle(
            op="add",
            id=f"{name}-{number}",
            shape=shape,  # type: ignore[arg-type]  # one of the two literals below
            size_m=size_m,
            position_m=outside,
            quaternion_xyzw=quaternion,
            script=way,
        )

    hand = body("hand", "box", list(config.hand_size_m), length_m / 2.0, [0.0, 0.0, 0.0, 1.0])
    forearm = body("forearm", "capsule", [config.forearm_radius_m, config.forearm_length_m], forearm_behind_tip_m, ALONG_X_XYZW)
    return hand, forearm


def _box_visits(rng: np.random.Generator, config: BoxesConfig, start_s: float) -> Iterator[Act]:
    at_s, number = start_s, 0
    while True:
        number += 1
        at_s += _draw(rng, config.pause_s)
        life_s = _draw(rng, config.life_s)
        size_m = [_draw(rng, config.edge_m) for _ in range(3)]
        position_m = [_draw(rng, config.x_m), _draw(rng, config.y_m), _draw(rng, config.z_m)]
        box = SetObstacle(op="add", id=f"box-{number}", shape="box", size_m=size_m, position_m=position_m)
        yield Act(at_s, life_s, (box,), is_sudden=True)
        at_s += life_s
