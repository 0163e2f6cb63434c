from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from common.robot.model import load_robot
from tests.support.cell import ur3_cell


@pytest.fixture(scope="module")
def robot():
    return load_robot(ur3_cell().robot)


def test_it_is_a_ur3_and_not_the_ur5_that_a_loader_gives(robot):
    frames = robot.joint_poses(np.zeros((1, 6)))[0]
    lengths = [np.linalg.norm(frames[j + 1, :3, 3] - frames[j, :3, 3]) for j in range(1, 6)]
    # Published UR3 dimensions: shoulder height 0.1519, upper arm 0.24365, forearm 0.21325, wrists 0.11235, 0.08535, 0.0819 m.
    assert frames[1, 2, 3] == pytest.approx(0.1519)
    assert lengths[0] == pytest.approx(0.1198)  # shoulder offset
    assert lengths[1] == pytest.approx(np.hypot(0.24365, 0.0925))
    assert lengths[2] == pytest.approx(0.21325)
    assert robot.joint_names[2] == "elbow_joint"


def test_published_poses_of_the_flange(robot):
    # All joints zero: the arm lies stretched along x; the flange is at the sum of the published lengths (DH of the UR3).
    flange = robot.joint_poses(np.zeros((1, 6)))[0, -1]
    assert flange[0, 3] == pytest.approx(0.24365 + 0.21325, abs=1e-9)
    assert flange[2, 3] == pytest.approx(0.1519 - 0.08535, abs=1e-9)
    up = robot.joint_poses(np.array([[0.0, -np.pi / 2, 0.0, -np.pi / 2, 0.0, 0.0]]))[0, -1]
    assert up[2, 3] == pytest.approx(0.1519 + 0.24365 + 0.21325 + 0.08535, abs=1e-9)


def test_the_kernel_equals_pinocchio(robot):
    model = pin.buildModelFromUrdf(str(robot.urdf_path))
    data = model.createData()
    rng = np.random.default_rng(7)
    q = rng.uniform(robot.position_min_rad, robot.position_max_rad, size=(50, 6))
    poses = robot.joint_poses(q)
    for k in range(len(q)):
        pin.forwardKinematics(model, data, q[k])
        for j in range(1, 7):
            np.testing.assert_allclose(poses[k, j], data.oMi[j].homogeneous, atol=1e-12)


def test_a_turned_base_turns_everything(robot):
    import msgspec

    turned = msgspec.structs.replace(ur3_cell().robot, base_position_m=(0.1, -0.2, 0.3), base_rpy_rad=(0.0, 0.0, np.pi / 2))
    q = np.array([[0.3, -1.0, 0.8, -0.2, 0.5, 0.1]])
    plain, moved = robot.joint_poses(q)[0, -1], load_robot(turned).joint_poses(q)[0, -1]
    assert moved[:3, 3] == pytest.approx([0.1 - plain[1, 3], -0.2 + plain[0, 3], 0.3 + plain[2, 3]])


@pytest.mark.parametrize(
    ("q", "words"),
    [
        ([0.0] * 5, "6 values"),
        ([0.0, 0.0, np.nan, 0.0, 0.0, 0.0], "elbow_joint"),
        ([0.0, 4.0, 0.0, 0.0, 0.0, 0.0], "shoulder_lift_joint: 4 rad"),
    ],
)
def test_limit_violations_name_joint_and_value(robot, q, words):
    assert words in robot.limit_violation(np.array(q))


def test_home_violates_nothing(robot):
    assert robot.limit_violation(robot.home_rad) is None
