"""The arms that ship: each is what it is called, by its maker's published kinematics."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from common import cell
from common.config import config_of_robot, robots
from common.robot.kernels import forward_kinematics_batch
from common.robot.model import chain_of
from common.robot.urdf import load_kinematics, resolve
from services.planner.config import PlannerConfig
from tests.support.published_kinematics import UR_TABLES, panda_flange, ur_flange


def load(name: str):
    """Config, pinocchio's model, and the chain of the kernels; no geometry, which takes a minute an arm."""
    config = cell.load(config_of_robot(name), "planner", PlannerConfig)[0].robot
    model, _ = load_kinematics(*resolve(config.urdf), config.locked_joints)
    return config, model, chain_of(model, config)


def poses(chain, q):
    rotation, translation = np.empty((len(q), q.shape[1] + 1, 3, 3)), np.empty((len(q), q.shape[1] + 1, 3))
    forward_kinematics_batch(chain, np.ascontiguousarray(q), rotation, translation)
    return rotation, translation


@pytest.mark.parametrize("name", robots())
def test_the_flange_is_where_the_makers_table_says(name: str) -> None:
    config, model, chain = load(name)
    published = panda_flange if name == "panda" else lambda q: ur_flange(name, q)
    T_joint_flange = model.frames[model.getFrameId(config.flange_frame)].placement.homogeneous
    q = np.random.default_rng(1).uniform(-np.pi, np.pi, (20, len(config.home_rad)))
    rotation, translation = poses(chain, np.vstack([q, np.zeros_like(q[:1]), config.home_rad]))
    for k, joints in enumerate(np.vstack([q, np.zeros_like(q[:1]), config.home_rad])):
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = rotation[k, -1], translation[k, -1]
        np.testing.assert_allclose(T @ T_joint_flange, published(joints), atol=1e-6)


@pytest.mark.parametrize("name", robots())
def test_the_kernel_equals_pinocchio(name: str) -> None:
    config, model, chain = load(name)
    q = np.random.default_rng(2).uniform(model.lowerPositionLimit, model.upperPositionLimit, (30, model.nq))
    rotation, translation = poses(chain, q)
    data = model.createData()
    for k in range(len(q)):
        pin.forwardKinematics(model, data, q[k])
        for j in range(1, model.njoints):
            np.testing.assert_allclose(rotation[k, j], data.oMi[j].rotation, atol=1e-12)
            np.testing.assert_allclose(translation[k, j], data.oMi[j].translation, atol=1e-12)
    assert model.nq == len(config.home_rad) == (7 if name == "panda" else 6)


@pytest.mark.parametrize("name", sorted(UR_TABLES))
def test_link_lengths_are_the_published_ones(name: str) -> None:
    d1, a2, a3, *_ = UR_TABLES[name]
    _, _, chain = load(name)
    assert chain.translation[0, 2] == pytest.approx(d1)
    # Along the upper arm and the forearm, whatever the description calls these axes; offsets lie along the joints' own axes.
    for j, length in ((2, -a2), (3, -a3)):
        along = chain.translation[j] - (chain.translation[j] @ chain.axis[j - 1]) * chain.axis[j - 1]
        assert np.linalg.norm(along) == pytest.approx(length)
