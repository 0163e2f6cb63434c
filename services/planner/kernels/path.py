"""Checks of segments and timed curves, pose by pose, at steps that no part of the arm outruns."""

from __future__ import annotations

import math

import numpy as np

from common.kernel import copy_row, kernel, leaf
from common.robot.kernels import FAR, body_grid, forward_kinematics, look_up, to_joint_frame
from services.planner.kernels.collision import FREE, farthest_m, no_slack, pose_hits_cell, way_verdict
from services.planner.kernels.moves import segment_steps

__all__ = ["cells_distance", "curve_verdict", "first_blocked", "leaves", "segment_verdict"]


@kernel
def segment_verdict(arm, solids, cells, safety_m, step_m, q_a, q_b):  # type: ignore[no-untyped-def]
    """Check the straight joint segment from ``q_a`` to ``q_b`` (J,), both ends included.

    Returns:
        (FREE | HIT_CELL | HIT_STATIC | HIT_SELF, index of what is hit, fraction 0..1 of the first blocked sample).
    """
    n_joints = len(q_a)
    rotation, translation = np.empty((2, n_joints + 1, 3, 3)), np.empty((2, n_joints + 1, 3))
    slack = no_slack(arm)
    dq, q = q_b - q_a, q_a.copy()
    n_steps = segment_steps(arm, q_a, dq, step_m, rotation, translation)
    turned = np.abs(dq) / n_steps
    for s in range(n_steps + 1):
        for j in range(n_joints):
            q[j] = q_a[j] + dq[j] * (s / n_steps)
        verdict, index = way_verdict(arm, solids, cells, safety_m, q, turned, step_m, slack, rotation[0], translation[0])
        if verdict != FREE:
            return verdict, index, s / n_steps
    return FREE, -1, 1.0


@kernel
def curve_verdict(arm, solids, cells, safety_m, step_m, t_s, q_rad, dq_rad_s, from_s, to_s):  # type: ignore[no-untyped-def]
    """Check the cubic Hermite curve of a trajectory between two times, ends included.

    Each knot interval is cut into equal times, so many that no point of the arm moves by more than ``step_m`` from one to the next: no
    joint turns faster than the fastest leg of the interval's Bezier polygon, and no point moves more than its lever times that.

    Returns:
        (verdict, index of what is hit, time in s of the first blocked sample or ``to_s``, number of poses checked).
    """
    n_joints = q_rad.shape[1]
    rotation, translation = np.empty((n_joints + 1, 3, 3)), np.empty((n_joints + 1, 3))
    slack, q, turned = no_slack(arm), np.empty(n_joints), np.zeros(n_joints)
    n_poses = 0
    for k in range(max(1, len(t_s) - 1)):
        begin_s, end_s = max(from_s, t_s[k]), min(to_s, t_s[min(k + 1, len(t_s) - 1)])
        if end_s < begin_s or (end_s == begin_s and n_poses > 0):
            continue
        _largest_turns(t_s, q_rad, dq_rad_s, k, end_s - begin_s, turned)
        n_steps = max(1, math.ceil(farthest_m(arm, turned) / step_m))
        for j in range(n_joints):
            turned[j] /= n_steps
        for s in range(0 if n_poses == 0 else 1, n_steps + 1):
            t = begin_s + (end_s - begin_s) * (s / n_steps)
            _hermite(t_s, q_rad, dq_rad_s, k, t, q)
            verdict, index = way_verdict(arm, solids, cells, safety_m, q, turned, step_m, slack, rotation, translation)
            n_poses += 1
            if verdict != FREE:
                return verdict, index, t, n_poses
    return FREE, -1, to_s, n_poses


@leaf
def _largest_turns(t_s, q_rad, dq_rad_s, k, within_s, turned):  # type: ignore[no-untyped-def]
    """Fill ``turned`` (J,) with the most that each joint can turn in ``within_s`` of knot interval ``k``.

    A cubic's rate is a mean of the legs of its Bezier polygon (times three), so the largest leg bounds it.
    """
    if len(t_s) == 1:
        turned[:] = 0.0
        return
    h = t_s[k + 1] - t_s[k]
    for j in range(len(turned)):
        first, last = dq_rad_s[k, j] * h / 3.0, dq_rad_s[k + 1, j] * h / 3.0
        middle = q_rad[k + 1, j] - q_rad[k, j] - first - last
        turned[j] = 3.0 * max(abs(first), abs(middle), abs(last)) * (within_s / h)


@leaf
def _hermite(t_s, q_rad, dq_rad_s, k, at_s, out):  # type: ignore[no-untyped-def]
    """Position at time ``at_s`` of knot interval ``k``: the interpolant of :mod:`common.robot.trajectory` (a test holds them equal)."""
    if len(t_s) == 1:
        copy_row(q_rad[0], out)
        return
    h = t_s[k + 1] - t_s[k]
    u = (at_s - t_s[k]) / h
    for j in range(q_rad.shape[1]):
        v0, v1, d = dq_rad_s[k, j] * h, dq_rad_s[k + 1, j] * h, q_rad[k + 1, j] - q_rad[k, j]
        out[j] = q_rad[k, j] + u * (v0 + u * ((3.0 * d - 2.0 * v0 - v1) + u * (v0 + v1 - 2.0 * d)))


@kernel
def first_blocked(arm, cells, safety_m, poses_rad):  # type: ignore[no-untyped-def]
    """Index of the first of ``poses_rad`` (K, J) that a cell blocks, or -1."""
    n_joints = poses_rad.shape[1]
    rotation, translation = np.empty((n_joints + 1, 3, 3)), np.empty((n_joints + 1, 3))
    for k in range(len(poses_rad)):
        forward_kinematics(arm.chain, poses_rad[k], rotation, translation)
        if pose_hits_cell(arm, cells, safety_m, rotation, translation) >= 0:
            return k
    return -1


@leaf
def cells_distance(arm, cells, rotation, translation):  # type: ignore[no-untyped-def]
    """Lower bound in metres of the distance from any moving body to any cell's centre, at most ``FAR``."""
    grids = arm.grids
    distance, centre = grids.distance, cells.centre_m
    nearest = FAR
    for b in range(len(arm.moving)):
        if not arm.moving[b]:
            continue
        j = grids.body_joint[b]
        turn, shift, grid = rotation[j], translation[j], body_grid(grids, b)
        for i in range(len(centre)):
            x, y, z = to_joint_frame(turn, shift, centre[i, 0], centre[i, 1], centre[i, 2])
            nearest = min(nearest, look_up(distance, grid, x, y, z))
    return nearest


@kernel
def leaves(arm, cells, reach_m, slack_m, poses_rad):  # type: ignore[no-untyped-def]
    """Whether the arm, standing among ``cells``, only moves away from them along ``poses_rad`` (K, J).

    The distance to the nearest centre never falls by more than ``slack_m`` below its best so far while it is below ``reach_m``.
    """
    n_joints = poses_rad.shape[1]
    rotation, translation = np.empty((n_joints + 1, 3, 3)), np.empty((n_joints + 1, 3))
    best = -np.inf
    for k in range(len(poses_rad)):
        forward_kinematics(arm.chain, poses_rad[k], rotation, translation)
        now = cells_distance(arm, cells, rotation, translation)
        if now < min(best, reach_m) - slack_m:
            return False
        best = max(best, now)
    return True
