"""Every built-in path can be followed from home, and what the arm does along it can be learned."""

from __future__ import annotations

import pytest

from clients.demonstrations import DEMONSTRATIONS
from common.wire.messages import Guide
from services.planner.config import MarginsConfig
from services.planner.core.learning import check_path
from services.planner.core.world import no_cells
from services.planner.offline.scene import Scene
from services.robot_sim.config import GuideConfig
from services.robot_sim.core.guiding import guided_curve
from services.robot_sim.translate import hand_points
from tests.support.cell import ur3, ur3_cell


@pytest.mark.parametrize("name", DEMONSTRATIONS)
def test_it_can_be_followed_and_learned(name: str) -> None:
    robot, scene = ur3(), Scene.of(ur3_cell(), MarginsConfig())
    curve = guided_curve(robot, robot.home_rad, hand_points(Guide(op="start", waypoints=DEMONSTRATIONS[name])), GuideConfig())
    assert len(check_path(curve.q_rad, robot, scene.checker(), no_cells(scene.grid))) > 50
