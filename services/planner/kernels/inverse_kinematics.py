"""Numerical inverse kinematics of any serial arm: damped least squares from many seeds, all branches kept.

Damping after Sugihara, "Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method" (IEEE T-RO 2011): half the
squared error plus a small bias, so that steps are careful far away and Gauss-Newton's near the solution.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from common.kernel import copy_row, kernel, leaf
from common.robot.kernels import Chain, forward_kinematics

__all__ = ["Arm", "find_branches"]

F64 = NDArray[np.float64]

MAX_ITERATIONS = 40  # our choice; measured: what converges does so within 8 to 20
DAMPING_BIAS = 1e-7  # our choice; Sugihara: 1e-3 link lengths squared, which is slow to polish
LENGTH_M = 0.3  # our choice: one radian of turn weighs as much as this many metres
POLISHED = 1e-20  # squared error: 1e-10 rad or 3e-11 m
SAME_BRANCH_RAD = 1e-3  # our choice: solutions nearer than this in every joint are one


class Arm(NamedTuple):
    """What the solver needs of an arm: chain, tool in the last joint's frame, limits (J,)."""

    chain: Chain
    T_joint_tool: F64  # (4, 4)
    position_min: F64
    position_max: F64


class Workspace(NamedTuple):
    """Scratch of one descent; J joints."""

    rotation: F64  # (J + 1, 3, 3)
    translation: F64  # (J + 1, 3)
    turn: F64  # (3, 3)
    error: F64  # (6,)
    jacobian: F64  # (J, 6)
    normal: F64  # (J, J)
    step: F64  # (J,)


@leaf
def _pose_error(arm: Arm, w: Workspace, T_goal: F64) -> float:
    """Fill ``w.error`` with what is missing to ``T_goal``: metres / LENGTH_M, then rotation vector in world; its squared norm."""
    R, T = w.rotation[len(w.step)], arm.T_joint_tool
    turn = w.turn  # T_goal's rotation times the inverse of the tool's
    for r in range(3):
        w.error[r] = (T_goal[r, 3] - w.translation[len(w.step), r] - R[r, 0] * T[0, 3] - R[r, 1] * T[1, 3] - R[r, 2] * T[2, 3]) / LENGTH_M
        for c in range(3):
            turn[r, c] = 0.0
            for k in range(3):
                turn[r, c] += T_goal[r, k] * (R[c, 0] * T[0, k] + R[c, 1] * T[1, k] + R[c, 2] * T[2, k])
    x, y, z = turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]
    sine = 0.5 * math.sqrt(x * x + y * y + z * z)
    angle = math.atan2(sine, 0.5 * (turn[0, 0] + turn[1, 1] + turn[2, 2] - 1.0))
    if sine > 1e-9:
        scale = 0.5 * angle / sine
        w.error[3], w.error[4], w.error[5] = scale * x, scale * y, scale * z
    else:  # none, or half a turn: then the axis is lost, and any large turn leads away from here
        w.error[3], w.error[4], w.error[5] = angle, 0.0, 0.0
    total = 0.0
    for r in range(6):
        total += w.error[r] * w.error[r]
    return total


@leaf
def _fill_jacobian(arm: Arm, w: Workspace) -> None:
    """Row j: motion of the tool point (over LENGTH_M) and turn, in world, for joint j."""
    n = len(w.step)
    R, T = w.rotation[n], arm.T_joint_tool
    tool_x = w.translation[n, 0] + R[0, 0] * T[0, 3] + R[0, 1] * T[1, 3] + R[0, 2] * T[2, 3]
    tool_y = w.translation[n, 1] + R[1, 0] * T[0, 3] + R[1, 1] * T[1, 3] + R[1, 2] * T[2, 3]
    tool_z = w.translation[n, 2] + R[2, 0] * T[0, 3] + R[2, 1] * T[1, 3] + R[2, 2] * T[2, 3]
    for j in range(n):
        row, F, axis = w.jacobian[j], w.rotation[j + 1], arm.chain.axis[j]
        ax = F[0, 0] * axis[0] + F[0, 1] * axis[1] + F[0, 2] * axis[2]
        ay = F[1, 0] * axis[0] + F[1, 1] * axis[1] + F[1, 2] * axis[2]
        az = F[2, 0] * axis[0] + F[2, 1] * axis[1] + F[2, 2] * axis[2]
        if arm.chain.prismatic[j]:
            row[0], row[1], row[2] = ax / LENGTH_M, ay / LENGTH_M, az / LENGTH_M
            row[3], row[4], row[5] = 0.0, 0.0, 0.0
            continue
        x, y, z = tool_x - w.translation[j + 1, 0], tool_y - w.translation[j + 1, 1], tool_z - w.translation[j + 1, 2]
        row[0], row[1], row[2] = (ay * z - az * y) / LENGTH_M, (az * x - ax * z) / LENGTH_M, (ax * y - ay * x) / LENGTH_M
        row[3], row[4], row[5] = ax, ay, az


@leaf
def _solve_step(w: Workspace, damping: float) -> None:
    """Fill ``w.step`` with the solution of (J^T J + damping) step = J^T e, by Cholesky in ``w.normal``."""
    n = len(w.step)
    for a in range(n):
        w.step[a] = 0.0
        for r in range(6):
            w.step[a] += w.jacobian[a, r] * w.error[r]
        for b in range(a + 1):
            total = damping if a == b else 0.0
            for r in range(6):
                total += w.jacobian[a, r] * w.jacobian[b, r]
            for k in range(b):
                total -= w.normal[a, k] * w.normal[b, k]
            w.normal[a, b] = math.sqrt(max(total, 1e-300)) if a == b else total / w.normal[b, b]
    for a in range(n):
        for k in range(a):
            w.step[a] -= w.normal[a, k] * w.step[k]
        w.step[a] /= w.normal[a, a]
    for a in range(n - 1, -1, -1):
        for k in range(a + 1, n):
            w.step[a] -= w.normal[k, a] * w.step[k]
        w.step[a] /= w.normal[a, a]


@leaf
def _descend(arm: Arm, w: Workspace, T_goal: F64, q: F64) -> bool:
    """Move ``q`` (J,) to a solution; False if none is reached."""
    for _ in range(MAX_ITERATIONS):
        forward_kinematics(arm.chain, q, w.rotation, w.translation)
        squared = _pose_error(arm, w, T_goal)
        if squared < POLISHED:
            return True
        _fill_jacobian(arm, w)
        _solve_step(w, 0.5 * squared + DAMPING_BIAS)
        for j in range(len(q)):
            q[j] += w.step[j]
    return False


@leaf
def _into_limits(arm: Arm, q: F64) -> bool:
    """Whole turns taken off, so that every joint lies within half a turn of the middle of its limits; whether all are within."""
    for j in range(len(q)):
        if not arm.chain.prismatic[j]:
            middle = 0.5 * (arm.position_min[j] + arm.position_max[j])
            q[j] -= 2.0 * math.pi * math.floor((q[j] - middle) / (2.0 * math.pi) + 0.5)
        if q[j] < arm.position_min[j] or q[j] > arm.position_max[j]:
            return False
    return True


@leaf
def _is_known(arm: Arm, q: F64, branches: F64, n_branches: int) -> bool:
    for i in range(n_branches):
        largest = 0.0
        for j in range(len(q)):
            d = abs(q[j] - branches[i, j])
            largest = max(largest, d if arm.chain.prismatic[j] else min(d, abs(2.0 * math.pi - d)))
        if largest < SAME_BRANCH_RAD:
            return True
    return False


@leaf
def _push_relatives(q: F64, queue: F64, n_queue: int) -> int:
    """Seeds near which the other branches often lie: one joint mirrored (elbow), three in a row flipped (wrist)."""
    n = len(q)
    for j in range(n):
        if n_queue < len(queue):
            copy_row(q, queue[n_queue])
            queue[n_queue, j] = -q[j]
            n_queue += 1
    for j in range(n - 2):
        if n_queue < len(queue):
            copy_row(q, queue[n_queue])
            queue[n_queue, j] += math.pi
            queue[n_queue, j + 1] *= -1.0
            queue[n_queue, j + 2] += math.pi
            n_queue += 1
    return n_queue


@kernel
def find_branches(arm: Arm, T_goal: F64, seeds: F64, queue: F64, branches: F64) -> int:
    """Solutions of ``T_goal`` (4, 4) within limits into ``branches`` (M, J), in the order found; their number, at most M.

    Tries ``seeds`` (S, J), and after each new branch first its relatives; ``queue`` (Q, J) is scratch for those.
    """
    n = seeds.shape[1]
    w = Workspace(
        np.empty((n + 1, 3, 3)), np.empty((n + 1, 3)), np.empty((3, 3)), np.empty(6), np.empty((n, 6)), np.empty((n, n)), np.empty(n)
    )
    q = np.empty(n)
    n_branches, n_queue, i_seed, i_queue = 0, 0, 0, 0
    while n_branches < len(branches):
        if i_queue < n_queue:
            q[:] = queue[i_queue]
            i_queue += 1
        elif i_seed < len(seeds):
            q[:] = seeds[i_seed]
            i_seed += 1
        else:
            break
        if _descend(arm, w, T_goal, q) and _into_limits(arm, q) and not _is_known(arm, q, branches, n_branches):
            branches[n_branches] = q
            n_branches += 1
            n_queue = _push_relatives(q, queue, n_queue)
    return n_branches
