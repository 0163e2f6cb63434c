"""The demo's script: same seed, same script; what it promises about goals, hands and boxes."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from clients.demo.config import DemoConfig
from clients.demo.script import Act, acts, goals
from common import cell
from common.wire.codec import encode
from common.wire.messages import SetObstacle


@pytest.fixture(scope="module")
def config() -> DemoConfig:
    return cell.load(None, "demo", DemoConfig)[1]


def bytes_of(script: list[Act]) -> list[tuple[float, float, list[bytes]]]:
    return [(act.at_s, act.life_s, [encode(obstacle) for obstacle in act.obstacles]) for act in script]


def until(config: DemoConfig, seed: int, seconds: float) -> list[Act]:
    script = []
    for act in acts(seed, config):
        if act.at_s > seconds:
            return script
        script.append(act)
    raise AssertionError("the script must not end")


def test_one_seed_one_script(config: DemoConfig) -> None:
    assert bytes_of(until(config, 3, 60.0)) == bytes_of(until(config, 3, 60.0))
    assert bytes_of(until(config, 3, 60.0)) != bytes_of(until(config, 4, 60.0))
    first, second = ([encode(goal.request) for goal in islice(goals(3, config), 20)] for _ in range(2))
    assert first == second


@pytest.mark.parametrize("seed", range(5))
def test_acts_come_by_time_with_names_of_their_own(config: DemoConfig, seed: int) -> None:
    script = until(config, seed, 300.0)
    times = [act.at_s for act in script]
    assert times == sorted(times)
    names = [obstacle.id for act in script for obstacle in act.obstacles]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("seed", range(5))
def test_two_minutes_hold_enough_to_dodge(config: DemoConfig, seed: int) -> None:
    script = until(config, seed, 120.0)
    assert sum(act.obstacles[0].id.startswith("hand") for act in script) >= 10
    assert sum(act.obstacles[0].id.startswith("box") for act in script) >= 10


def test_goals_alternate_and_lie_in_their_regions_with_the_tool_down(config: DemoConfig) -> None:
    for n, goal in enumerate(islice(goals(0, config), 100)):
        assert goal.region == ("pick", "place")[n % 2]
        region = getattr(config, goal.region)
        pose = goal.request.pose
        assert pose is not None
        assert np.all(np.asarray(pose.position_m) >= region.min_m)
        assert np.all(np.asarray(pose.position_m) <= region.max_m)
        assert Rotation.from_quat(pose.quaternion_xyzw).apply([0.0, 0.0, 1.0]) == pytest.approx([0.0, 0.0, -1.0], abs=1e-12)


def hand_and_forearm(config: DemoConfig) -> tuple[SetObstacle, SetObstacle, Act]:
    visit = next(act for act in acts(1, config) if not act.is_sudden)
    hand, forearm = visit.obstacles
    return hand, forearm, visit


def test_hand_and_forearm_move_as_one_at_the_stated_speed(config: DemoConfig) -> None:
    hand, forearm, visit = hand_and_forearm(config)
    assert hand.script is not None
    assert forearm.script is not None
    gaps = [np.subtract(f.position_m, h.position_m) for h, f in zip(hand.script, forearm.script, strict=True)]
    assert np.ptp(gaps, axis=0) == pytest.approx(np.zeros(3), abs=1e-12)
    assert {w.speed_m_s for w in hand.script + forearm.script} == {0.25}
    way_m = 2.0 * np.linalg.norm(np.subtract(hand.script[0].position_m, hand.script[1].position_m))
    assert visit.life_s >= way_m / 0.25 + hand.script[0].rest_s


def test_the_forearm_lies_along_x_and_meets_the_hand(config: DemoConfig) -> None:
    hand, forearm, _ = hand_and_forearm(config)
    assert forearm.quaternion_xyzw is not None
    assert forearm.size_m is not None
    assert hand.size_m is not None
    assert np.abs(Rotation.from_quat(forearm.quaternion_xyzw).apply([0.0, 0.0, 1.0])) == pytest.approx([1.0, 0.0, 0.0], abs=1e-12)
    apart_m = np.subtract(forearm.position_m, hand.position_m)[0]
    assert apart_m == pytest.approx(hand.size_m[0] / 2 + forearm.size_m[1] / 2)


def test_nothing_moving_appears_within_reach_of_the_arm(config: DemoConfig) -> None:
    hand, _, _ = hand_and_forearm(config)
    assert hand.position_m is not None
    assert hand.size_m is not None
    reach_m = 0.5 + 0.24 + 0.1  # upper arm and forearm 0.24 + 0.21, wrist and tool below 0.3
    assert hand.position_m[0] - hand.size_m[0] / 2 > reach_m
