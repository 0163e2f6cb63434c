"""The convex pieces that stand for an arm's bodies in the physics engine."""

from __future__ import annotations

from types import SimpleNamespace

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import ConvexHull

from common import cell
from common.config import config_of_robot
from common.robot.pairs import coal_mesh
from common.robot.urdf import load_bodies, load_kinematics, resolve
from services.robot_sim.adapters.convex import convex_pieces
from services.robot_sim.config import RobotSimConfig

NEAR_M = 0.003  # no way of the planner brings two bodies nearer (measured: services/planner/core/arm.py, NEAR_MARGIN_M)
SKIN_M = 0.001  # what PyBullet adds to each mesh


def _hull(points: np.ndarray) -> coal.BVHModelOBBRSS:
    return coal_mesh(SimpleNamespace(vertices=points, triangles=ConvexHull(points).simplices))  # type: ignore[arg-type]


@pytest.mark.parametrize(("first", "second", "joint"), [("base_link", "upper_arm_link", 0), ("forearm_link", "wrist_2_link", 3)])
def test_bodies_that_pass_each_other_closely_touch_only_where_they_nearly_do(first: str, second: str, joint: int) -> None:
    """Else the arm is told to touch itself where it does not. The second body moves past the first by ``joint`` and the next one."""
    config = cell.load(config_of_robot("ur5"), "robot_sim", RobotSimConfig)[0].robot
    path, folders = resolve(config.urdf)
    model, geometry = load_kinematics(path, folders, config.locked_joints)
    named = {body.name: body for body in load_bodies(model, geometry, config.immobile_links)}
    bodies = named[first], named[second]
    meshes, pieces = [coal_mesh(body) for body in bodies], [[_hull(points) for points in convex_pieces(body)] for body in bodies]
    data, rng, n_near = model.createData(), np.random.default_rng(0), 0
    request = coal.CollisionRequest()
    request.security_margin = 2.0 * SKIN_M
    for _ in range(600):
        q = np.zeros(model.nq)
        q[joint : joint + 2] = rng.uniform(-np.pi, np.pi, 2)
        pin.forwardKinematics(model, data, q)
        places = [coal.Transform3s(data.oMi[body.joint].rotation, data.oMi[body.joint].translation) for body in bodies]
        ask = coal.DistanceRequest(), coal.DistanceResult()
        apart_m = coal.distance(meshes[0], places[0], meshes[1], places[1], *ask)
        if not NEAR_M < apart_m < 0.02:
            continue
        n_near += 1
        for a in pieces[0]:
            for b in pieces[1]:
                assert not coal.collide(a, places[0], b, places[1], request, coal.CollisionResult()), (q, apart_m)
    assert n_near > 100
