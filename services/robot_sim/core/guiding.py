"""Hand guidance: a hand takes the tool and drags it along a path; the arm follows by inverse kinematics.

The follower runs over the whole path before anything moves: what it cannot do is refused at once, and what it can is an ordinary curve that
the executor admits, drives and brakes like any other. Of the two ways to simulate a hand, a force on a compliant arm and a follower,
this is the follower: deterministic, the same for any arm, and every limit of the reference holds.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from common.errors import RequestError
from common.robot.model import RobotModel
from common.robot.trajectory import JointTrajectory
from services.robot_sim.config import GuideConfig
from services.robot_sim.core.follower_kernels import follow
from services.robot_sim.core.hand import STEP_S, HandPath, HandPoint, hand_path

__all__ = ["guided_curve"]

F64 = NDArray[np.float64]


def guided_curve(robot: RobotModel, q_rad: F64, points: Sequence[HandPoint], config: GuideConfig) -> JointTrajectory:
    """The curve, from rest to rest, that an arm at ``q_rad`` (J,) is dragged along.

    Raises:
        RequestError: a waypoint makes no sense, or the tool cannot follow the hand: it would leave its limits or its reach. Names the
            waypoint and how far the tool stays behind.
    """
    hand = hand_path(robot.tool_pose(q_rad), points, config)
    n = len(hand.position_m) + round(config.settle_s / STEP_S)
    q, dq, lag = np.zeros((n, robot.n_joints)), np.zeros((n, robot.n_joints)), np.zeros((n, 2))
    q[0] = q_rad
    filled = follow(
        robot.chain, np.ascontiguousarray(robot.T_joint_tool), hand.position_m, hand.rotation, STEP_S, config.pull_per_s, config.damping,
        robot.position_min_rad, robot.position_max_rad, config.velocity_share * robot.max_velocity_rad_s,
        config.acceleration_share * robot.max_acceleration_rad_s2, (config.near_m, config.near_rad), q, dq, lag,
    )  # fmt: skip
    _refuse_if_left_behind(hand, lag[:filled], config)
    if np.any(dq[filled - 1] != 0.0):
        raise _left_behind(len(points) - 1, lag[filled - 1])
    return JointTrajectory(np.arange(filled) * STEP_S, q[:filled].copy(), dq[:filled].copy())


def _refuse_if_left_behind(hand: HandPath, lag: F64, config: GuideConfig) -> None:
    behind = (lag[:, 0] > config.lag_max_m) | (lag[:, 1] > config.lag_max_rad)
    if behind.any():
        k = int(np.argmax(behind))
        raise _left_behind(min(int(np.searchsorted(hand.arrives, k)), len(hand.arrives) - 1), lag[k])


def _left_behind(waypoint: int, lag: F64) -> RequestError:
    return RequestError(
        f"waypoints[{waypoint}]: the tool cannot follow the hand there: it stays {lag[0]:.3f} m and {lag[1]:.3f} rad behind "
        "(out of reach, or a joint at its limit)",
        code="out_of_reach",
        facts={"index": waypoint, "behind_m": float(lag[0]), "behind_rad": float(lag[1])},
    )
