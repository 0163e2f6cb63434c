"""The arm as it yields to a hand at its tool, instant by instant. Twin: ``tests/support/slow_follower.py``."""

from __future__ import annotations

import math

import numpy as np

from common.kernel import kernel, leaf
from common.robot.kernels import forward_kinematics

__all__ = ["follow"]


@kernel
def follow(  # type: ignore[no-untyped-def]
    chain,
    T_joint_tool,
    hand_m,
    hand_turn,
    step_s,
    pull_per_s,
    damping,
    low,
    high,
    max_speed,
    max_acceleration,
    near,
    q,
    dq,
    lag,
):
    """Fill ``q``, ``dq`` (K, J) from their first rows on, and ``lag`` (K, 2): how far the tool is behind the hand, in metres and radians.

    At each step the tool is drawn towards the hand with a velocity in proportion to the distance; damped least squares make joint
    velocities of it (Wampler 1986); they are slowed together to ``max_speed``, each such that it can stop before its position limit, and
    change by no more than ``max_acceleration`` allows. Between two steps the acceleration is constant, so that the cubic Hermite curve
    through the steps keeps exactly these limits. When the hand rests at its end and the tool is near, the arm comes to rest.

    Args:
        chain, T_joint_tool: the arm and its tool frame in the last joint's.
        hand_m, hand_turn: (H, 3), (H, 3, 3) the hand at each step; it stays at its end.
        step_s, pull_per_s, damping: time step, gain of the pull, damping of the least squares (m, rad).
        low, high, max_speed, max_acceleration: (J,) limits.
        near: metres and radians that count as being where the hand is.

    Returns:
        Number of rows filled; K when the arm did not come to rest.
    """
    n_joints = q.shape[1]
    rotation, translation = np.empty((n_joints + 1, 3, 3)), np.empty((n_joints + 1, 3))
    jacobian, pull, wanted = np.zeros((6, n_joints)), np.empty(6), np.empty(n_joints)
    settles = False
    for k in range(len(q)):
        forward_kinematics(chain, q[k], rotation, translation)
        h = min(k, len(hand_m) - 1)
        _pull(rotation, translation, T_joint_tool, hand_m[h], hand_turn[h], pull)
        lag[k, 0] = math.sqrt(pull[0] ** 2 + pull[1] ** 2 + pull[2] ** 2)
        lag[k, 1] = math.sqrt(pull[3] ** 2 + pull[4] ** 2 + pull[5] ** 2)
        settles = settles or (k >= len(hand_m) - 1 and lag[k, 0] < near[0] and lag[k, 1] < near[1])
        if settles and np.all(dq[k] == 0.0):
            return k + 1
        if k == len(q) - 1:
            break
        wanted[:] = 0.0
        if not settles:
            _jacobian(chain, rotation, translation, T_joint_tool, jacobian)
            square = jacobian @ jacobian.T
            for r in range(6):
                square[r, r] += damping * damping
            wanted[:] = jacobian.T @ np.linalg.solve(square, pull_per_s * pull)
            _slow_down(wanted, q[k], dq[k], step_s, low, high, max_speed, max_acceleration)
        for j in range(n_joints):
            most = max_acceleration[j] * step_s
            change = wanted[j] - dq[k, j]
            dq[k + 1, j] = wanted[j] if abs(change) <= most else dq[k, j] + math.copysign(most, change)
            q[k + 1, j] = q[k, j] + 0.5 * (dq[k, j] + dq[k + 1, j]) * step_s
    return len(q)


@kernel
def _pull(rotation, translation, T_joint_tool, hand_m, hand_turn, out):  # type: ignore[no-untyped-def]
    """From the tool to the hand: (6,) metres, and radians as a rotation vector, both in the world."""
    turn = rotation[-1] @ np.ascontiguousarray(T_joint_tool[:3, :3])
    for r in range(3):
        place = translation[-1, r]
        for c in range(3):
            place += rotation[-1, r, c] * T_joint_tool[c, 3]
        out[r] = hand_m[r] - place
    between = hand_turn @ turn.T
    x, y, z = between[2, 1] - between[1, 2], between[0, 2] - between[2, 0], between[1, 0] - between[0, 1]
    sine, cosine = 0.5 * math.sqrt(x * x + y * y + z * z), 0.5 * (between[0, 0] + between[1, 1] + between[2, 2] - 1.0)
    # Half a turn has no one axis; a hand that is so far ahead was refused before (its own turns are slower than the pull).
    scale = 0.5 if sine < 1e-9 else 0.5 * math.atan2(sine, cosine) / sine
    out[3], out[4], out[5] = scale * x, scale * y, scale * z


@kernel
def _jacobian(chain, rotation, translation, T_joint_tool, out):  # type: ignore[no-untyped-def]
    """Geometric Jacobian (6, J) of the tool frame in the world."""
    tool = translation[-1] + rotation[-1] @ np.ascontiguousarray(T_joint_tool[:3, 3])
    for j in range(out.shape[1]):
        axis = rotation[j + 1] @ chain.axis[j]
        if chain.prismatic[j]:
            out[:3, j], out[3:, j] = axis, 0.0
        else:
            out[:3, j], out[3:, j] = np.cross(axis, tool - translation[j + 1]), axis


@leaf
def _slow_down(wanted, q, dq, step_s, low, high, max_speed, max_acceleration):  # type: ignore[no-untyped-def]
    """Scale ``wanted`` (J,) to the speed limits, then hold each joint to what it can brake from before its position limit."""
    excess = 1.0
    for j in range(len(wanted)):
        excess = max(excess, abs(wanted[j]) / max_speed[j])
    for j in range(len(wanted)):
        wanted[j] /= excess
        half_way = 0.5 * dq[j] * step_s  # what the present speed still covers in this step
        up = _stoppable(high[j] - q[j] - half_way, max_acceleration[j], step_s)
        down = _stoppable(q[j] - low[j] + half_way, max_acceleration[j], step_s)
        wanted[j] = min(max(wanted[j], -down), up)


@leaf
def _stoppable(room, acceleration, step_s):  # type: ignore[no-untyped-def]
    """The speed v that steps of constant deceleration still stop within ``room``: v step + v^2 / (2 a) = room."""
    return acceleration * (math.sqrt(step_s * step_s + 2.0 * max(room, 0.0) / acceleration) - step_s)
