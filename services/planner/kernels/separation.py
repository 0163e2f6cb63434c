"""How fast the arm may be along a path, by its separation from cells: speed and separation monitoring.

Referees: the law as the standard writes it, coal's distances and finite differences (``tests/unit/planner/test_separation.py``).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from common.robot.body_distance import to_world
from common.robot.kernels import forward_kinematics, to_joint_frame
from services.planner.kernels.cells import BLOCK
from services.planner.kernels.collision import ROOT3
from services.planner.kernels.reach import look_far, reach_grid

__all__ = ["SpeedLaw", "allowed_speed", "body_separation", "needed_separation", "speed_caps"]


class SpeedLaw(NamedTuple):
    """Speed and separation monitoring, ISO/TS 15066 5.5.4; see ``SeparationConfig`` of the planner."""

    person_m_s: float  # v_h: speed of what may come nearer
    reaction_s: float  # T_r: until the arm begins to brake
    braking_m_s2: float  # a
    reduced_m_s: float  # allowed at any separation


@njit(cache=True, nogil=True)
def needed_separation(law, speed_m_s):  # type: ignore[no-untyped-def]
    """S_h + S_r + S_s in metres at a speed of a point of the arm."""
    stop_s = speed_m_s / law.braking_m_s2
    return law.person_m_s * (law.reaction_s + stop_s) + speed_m_s * law.reaction_s + 0.5 * speed_m_s * stop_s


@njit(cache=True, nogil=True)
def allowed_speed(law, separation_m):  # type: ignore[no-untyped-def]
    """The largest speed in m/s whose :func:`needed_separation` is at most ``separation_m``, and never less than the reduced speed."""
    half_b = law.person_m_s + law.braking_m_s2 * law.reaction_s  # v^2 + 2 half_b v = 2 a (S - v_h T_r)
    room = 2.0 * law.braking_m_s2 * (separation_m - law.person_m_s * law.reaction_s)
    if room <= 0.0:
        return law.reduced_m_s
    return max(law.reduced_m_s, math.sqrt(half_b * half_b + room) - half_b)


@njit(cache=True, nogil=True)
def body_separation(arm, reach, cells, b, turn, shift, enough_m):  # type: ignore[no-untyped-def]
    """Lower bound in metres of the distance of body ``b`` to all cells, at most ``enough_m``; ``turn``, ``shift``: its frame.

    Within ``reach`` by its grid, to each cell's ball; beyond by the spheres that contain the body.
    """
    grids, centre = arm.grids, cells.centre_m
    distance, grid = reach.distance, reach_grid(reach, b)
    ball_m = cells.half_m * ROOT3
    best = enough_m
    for p in range(grids.part_offset[b], grids.part_offset[b + 1]):
        cx, cy, cz = to_world(turn, shift, grids.part_m, p)
        radius = grids.part_m[p, 3] + ball_m
        for k in range(len(cells.block_m)):
            dx, dy, dz = cells.block_m[k, 0] - cx, cells.block_m[k, 1] - cy, cells.block_m[k, 2] - cz
            if math.sqrt(dx * dx + dy * dy + dz * dz) - cells.block_m[k, 3] - radius >= best:
                continue
            for i in range(k * BLOCK, min((k + 1) * BLOCK, len(centre))):
                dx, dy, dz = centre[i, 0] - cx, centre[i, 1] - cy, centre[i, 2] - cz
                apart = math.sqrt(dx * dx + dy * dy + dz * dz) - radius
                if apart < best:
                    x, y, z = to_joint_frame(turn, shift, centre[i, 0], centre[i, 1], centre[i, 2])
                    best = min(best, max(apart, look_far(distance, grid, x, y, z) - ball_m))
    return best


@njit(cache=True, nogil=True)
def _body_rates(arm, dq, rotation, translation, rate):  # type: ignore[no-untyped-def]
    """Fill ``rate`` (B,) with the fastest speed of any point of each body, in metres per unit, while the joints turn by ``dq`` (J,) a unit.

    A body's points move as one rigid body, so none is faster than the fastest corner of its box.
    """
    chain, grids = arm.chain, arm.grids
    n_frames = len(dq) + 1
    turning, moving = np.zeros((n_frames, 3)), np.zeros((n_frames, 3))
    for j in range(1, n_frames):
        a, t = chain.axis[j - 1], translation[j]
        x, y, z = t[0] - translation[j - 1, 0], t[1] - translation[j - 1, 1], t[2] - translation[j - 1, 2]
        wx, wy, wz = turning[j - 1]
        moving[j, 0] = moving[j - 1, 0] + wy * z - wz * y
        moving[j, 1] = moving[j - 1, 1] + wz * x - wx * z
        moving[j, 2] = moving[j - 1, 2] + wx * y - wy * x
        for r in range(3):
            axis = rotation[j, r, 0] * a[0] + rotation[j, r, 1] * a[1] + rotation[j, r, 2] * a[2]
            turning[j, r] = turning[j - 1, r]
            if chain.prismatic[j - 1]:
                moving[j, r] += dq[j - 1] * axis
            else:
                turning[j, r] += dq[j - 1] * axis
    for b in range(len(arm.moving)):
        j = grids.body_joint[b]
        wx, wy, wz = turning[j]
        fastest2 = 0.0
        for corner in range(8):
            u = grids.box_max_m[b, 0] if corner & 1 else grids.box_min_m[b, 0]
            v = grids.box_max_m[b, 1] if corner & 2 else grids.box_min_m[b, 1]
            w = grids.box_max_m[b, 2] if corner & 4 else grids.box_min_m[b, 2]
            x = rotation[j, 0, 0] * u + rotation[j, 0, 1] * v + rotation[j, 0, 2] * w
            y = rotation[j, 1, 0] * u + rotation[j, 1, 1] * v + rotation[j, 1, 2] * w
            z = rotation[j, 2, 0] * u + rotation[j, 2, 1] * v + rotation[j, 2, 2] * w
            vx, vy, vz = moving[j, 0] + wy * z - wz * y, moving[j, 1] + wz * x - wx * z, moving[j, 2] + wx * y - wy * x
            fastest2 = max(fastest2, vx * vx + vy * vy + vz * vz)
        rate[b] = math.sqrt(fastest2)


@njit(cache=True, nogil=True, inline="always")
def _moved_m(s, rate, i, b):  # type: ignore[no-untyped-def]
    """How far any point of body ``b`` moves from sample ``i`` to the next, by the larger of the two rates."""
    return (s[i + 1] - s[i]) * max(rate[i, b], rate[i + 1, b])


@njit(cache=True, nogil=True)
def _cap_body(arm, reach, cells, law, s, b, rate, possible, rotation, translation, apart, cap):  # type: ignore[no-untyped-def]
    """:func:`speed_caps` of body ``b``.

    ``rate`` (N, B): how fast its points are per unit of ``s``; ``possible`` (N,): ds/dt at the most; ``apart`` (N,): scratch.
    """
    n = len(s)
    turn, shift = rotation[:, arm.grids.body_joint[b]], translation[:, arm.grids.body_joint[b]]
    fastest = 0.0
    for i in range(n):
        fastest = max(fastest, rate[i, b] * possible[i])
    if fastest <= law.reduced_m_s:
        return
    enough_m = needed_separation(law, fastest)
    for i in range(n):
        left_m = apart[i - 1] - _moved_m(s, rate, i - 1, b) if i > 0 else 0.0
        # Where it is looked at all, then farther than enough, so that the next samples need no look.
        apart[i] = left_m if left_m >= enough_m else body_separation(arm, reach, cells, b, turn[i], shift[i], 2.0 * enough_m)
    for i in range(n - 1):
        speed = allowed_speed(law, min(0.5 * (apart[i] + apart[i + 1] - _moved_m(s, rate, i, b)), apart[i], apart[i + 1]))
        for end in range(i, i + 2):
            if rate[end, b] > 1e-9:
                cap[end] = min(cap[end], (speed / rate[end, b]) ** 2)


@njit(cache=True, nogil=True)
def speed_caps(arm, reach, cells, law, s, q, d1, velocity, cap):  # type: ignore[no-untyped-def]
    """Lower ``cap`` (N,), bounds of (ds/dt)^2 at samples of a path, to what ``law`` allows each moving body at its separation from cells.

    Between two samples a body may be nearer than at either, by half of what it moves beyond their difference: a sample's bound takes in
    both of its pieces. A body that cannot be faster than the reduced speed is not looked at.

    Args:
        reach: grids that reach beyond the fine ones.
        s: (N,) path parameters. q, d1: (N, J) points of the path and its derivative by ``s``.
        velocity: (J,) joint limits, which the motion keeps anyway.
    """
    n, n_joints, n_bodies = len(s), q.shape[1], len(arm.moving)
    if len(cells.centre_m) == 0:
        return
    rotation, translation = np.empty((n, n_joints + 1, 3, 3)), np.empty((n, n_joints + 1, 3))
    rate, possible, apart = np.empty((n, n_bodies)), np.empty(n), np.empty(n)
    for i in range(n):
        forward_kinematics(arm.chain, q[i], rotation[i], translation[i])
        _body_rates(arm, d1[i], rotation[i], translation[i], rate[i])
        possible[i] = math.sqrt(cap[i])
        for j in range(n_joints):
            if abs(d1[i, j]) > 1e-12:
                possible[i] = min(possible[i], velocity[j] / abs(d1[i, j]))
    for b in range(n_bodies):
        if arm.moving[b]:
            _cap_body(arm, reach, cells, law, s, b, rate, possible, rotation, translation, apart, cap)
