"""How fast the arm may be along a path, by its separation from cells: speed and separation monitoring.

Referees: the law as the standard writes it, coal's distances and finite differences (``tests/unit/planner/test_separation.py``).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from common.kernel import kernel, leaf
from common.robot.body_distance import to_world
from common.robot.kernels import forward_kinematics, to_joint_frame
from services.planner.kernels.body_cells import ROOT3
from services.planner.kernels.cells import BLOCK, GROUP
from services.planner.kernels.reach import look_far, reach_grid

__all__ = ["SpeedLaw", "allowed_speed", "body_separation", "caps_among", "needed_separation", "speed_caps"]


class SpeedLaw(NamedTuple):
    """Speed and separation monitoring, ISO/TS 15066 5.5.4; see ``SeparationConfig`` of the planner."""

    person_m_s: float  # v_h: speed of what may come nearer
    reaction_s: float  # T_r: until the arm begins to brake
    braking_m_s2: float  # a
    reduced_m_s: float  # allowed at any separation


@leaf
def needed_separation(law, speed_m_s):  # type: ignore[no-untyped-def]
    """S_h + S_r + S_s in metres at a speed of a point of the arm."""
    stop_s = speed_m_s / law.braking_m_s2
    return law.person_m_s * (law.reaction_s + stop_s) + speed_m_s * law.reaction_s + 0.5 * speed_m_s * stop_s


@leaf
def allowed_speed(law, separation_m):  # type: ignore[no-untyped-def]
    """The largest speed in m/s whose :func:`needed_separation` is at most ``separation_m``, and never less than the reduced speed."""
    half_b = law.person_m_s + law.braking_m_s2 * law.reaction_s  # v^2 + 2 half_b v = 2 a (S - v_h T_r)
    room = 2.0 * law.braking_m_s2 * (separation_m - law.person_m_s * law.reaction_s)
    if room <= 0.0:
        return law.reduced_m_s
    return max(law.reduced_m_s, math.sqrt(half_b * half_b + room) - half_b)


@leaf
def body_separation(arm, reach, cells, b, turn, shift, enough_m):  # type: ignore[no-untyped-def]
    """Lower bound in metres of the distance of body ``b`` to all cells, at most ``enough_m``; ``turn``, ``shift``: its frame.

    Within ``reach`` by its grid, to each cell's ball; beyond by the spheres that contain the body. The nearest block is looked into first:
    most others cannot be nearer then.
    """
    grids, group, block = arm.grids, cells.group_m, cells.block_m
    bx, by, bz = to_world(turn, shift, grids.bound_centre_m, b)
    around = grids.bound_radius_m[b] + cells.half_m * ROOT3
    g = _nearest_sphere(group, 0, len(group), bx, by, bz)
    nearest = _nearest_sphere(block, g * GROUP, min((g + 1) * GROUP, len(block)), bx, by, bz)
    best = _to_block(arm, reach, cells, b, nearest, turn, shift, enough_m)
    for g in range(len(group)):
        if _is_beyond(group, g, bx, by, bz, best + around):
            continue
        for k in range(g * GROUP, min((g + 1) * GROUP, len(block))):
            if k != nearest and not _is_beyond(block, k, bx, by, bz, best + around):
                best = _to_block(arm, reach, cells, b, k, turn, shift, best)
    return best


@leaf
def _is_beyond(spheres_m, k, x, y, z, reach_m):  # type: ignore[no-untyped-def]
    """Whether nothing in a sphere is within ``reach_m`` of a point."""
    dx, dy, dz, within = spheres_m[k, 0] - x, spheres_m[k, 1] - y, spheres_m[k, 2] - z, reach_m + spheres_m[k, 3]
    return dx * dx + dy * dy + dz * dz >= within * within


@leaf
def _nearest_sphere(spheres_m, first, last, x, y, z):  # type: ignore[no-untyped-def]
    """Which of the spheres ``first`` to ``last`` (not included) is nearest to a point."""
    nearest, least = first, np.inf
    for k in range(first, last):
        dx, dy, dz = spheres_m[k, 0] - x, spheres_m[k, 1] - y, spheres_m[k, 2] - z
        apart = math.sqrt(dx * dx + dy * dy + dz * dz) - spheres_m[k, 3]
        if apart < least:
            nearest, least = k, apart
    return nearest


@leaf
def _to_block(arm, reach, cells, b, k, turn, shift, enough_m):  # type: ignore[no-untyped-def]
    """:func:`body_separation` of the cells of block ``k`` alone."""
    grids, centre, ball_m, best = arm.grids, cells.centre_m, cells.half_m * ROOT3, enough_m
    distance, grid = reach.distance, reach_grid(reach, b)
    for p in range(grids.part_offset[b], grids.part_offset[b + 1]):
        cx, cy, cz = to_world(turn, shift, grids.part_m, p)
        radius = grids.part_m[p, 3] + ball_m
        if _is_beyond(cells.block_m, k, cx, cy, cz, best + radius):
            continue
        for i in range(k * BLOCK, min((k + 1) * BLOCK, len(centre))):
            dx, dy, dz = centre[i, 0] - cx, centre[i, 1] - cy, centre[i, 2] - cz
            apart2, within = dx * dx + dy * dy + dz * dz, best + radius
            if apart2 < within * within:
                x, y, z = to_joint_frame(turn, shift, centre[i, 0], centre[i, 1], centre[i, 2])
                best = min(best, max(math.sqrt(apart2) - radius, look_far(distance, grid, x, y, z) - ball_m))
    return best


@leaf
def _body_rates(arm, dq, rotation, translation, scratch, rate):  # type: ignore[no-untyped-def]
    """Fill ``rate`` (B,) with the fastest speed of any point of each body, in metres per unit, while the joints turn by ``dq`` (J,) a unit.

    A body's points move as one rigid body, so none is faster than the fastest corner of its box. ``scratch`` (2 J + 3, 3).
    """
    chain, grids = arm.chain, arm.grids
    n_frames = len(dq) + 1
    turning, moving, origin = scratch[:n_frames], scratch[n_frames : 2 * n_frames], scratch[2 * n_frames]
    scratch[:] = 0.0
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
        # Seen from the body's frame, where its box is upright.
        wx, wy, wz = to_joint_frame(rotation[j], origin, turning[j, 0], turning[j, 1], turning[j, 2])
        vx, vy, vz = to_joint_frame(rotation[j], origin, moving[j, 0], moving[j, 1], moving[j, 2])
        fastest2 = 0.0
        for end_u in range(2):
            u = grids.box_max_m[b, 0] if end_u else grids.box_min_m[b, 0]
            for end_v in range(2):
                v = grids.box_max_m[b, 1] if end_v else grids.box_min_m[b, 1]
                x, y, z = vx - wz * v, vy + wz * u, vz + wx * v - wy * u
                for end_w in range(2):
                    w = grids.box_max_m[b, 2] if end_w else grids.box_min_m[b, 2]
                    speed2 = (x + wy * w) ** 2 + (y - wx * w) ** 2 + z**2
                    fastest2 = max(fastest2, speed2)
        rate[b] = math.sqrt(fastest2)


@leaf
def _moved_m(s, rate, i, b):  # type: ignore[no-untyped-def]
    """How far any point of body ``b`` moves from sample ``i`` to the next, by the larger of the two rates."""
    return (s[i + 1] - s[i]) * max(rate[i, b], rate[i + 1, b])


@leaf
def _enough_m(law, s, b, rate, speed, i):  # type: ignore[no-untyped-def]
    """The separation of body ``b`` at sample ``i`` from which on its two pieces bound nothing; 0 where reduced speed is enough."""
    fastest, moved_m = 0.0, 0.0
    for k in range(max(0, i - 1), min(len(s), i + 2)):
        fastest = max(fastest, rate[k, b] * speed[k])
    for k in range(max(0, i - 1), min(len(s) - 1, i + 1)):
        moved_m = max(moved_m, _moved_m(s, rate, k, b))
    return 0.0 if fastest <= law.reduced_m_s else needed_separation(law, fastest) + 0.5 * moved_m


@leaf
def _cap_body(arm, reach, cells, law, s, b, rate, speed, rotation, translation, apart, cap):  # type: ignore[no-untyped-def]
    """:func:`speed_caps` of body ``b``.

    ``rate`` (N, B): how fast its points are per unit of ``s``; ``apart`` (N,): scratch.
    """
    turn, shift = rotation[:, arm.grids.body_joint[b]], translation[:, arm.grids.body_joint[b]]
    looked = False
    for i in range(len(s)):
        moved_m = _moved_m(s, rate, i - 1, b) if i > 0 else 0.0
        left_m = apart[i - 1] - moved_m if i > 0 else 0.0
        enough_m = _enough_m(law, s, b, rate, speed, i)
        if enough_m == 0.0 or left_m >= enough_m:
            apart[i], looked = left_m, False
            continue
        # Farther than enough, so that the next samples may need no look; but it cannot be farther than it was and has moved.
        far_m = min(2.0 * enough_m, apart[i - 1] + moved_m) if looked else 2.0 * enough_m
        apart[i], looked = body_separation(arm, reach, cells, b, turn[i], shift[i], far_m), True
    for i in range(len(s) - 1):
        if max(rate[i, b] * speed[i], rate[i + 1, b] * speed[i + 1]) <= law.reduced_m_s:
            continue
        allowed = allowed_speed(law, min(0.5 * (apart[i] + apart[i + 1] - _moved_m(s, rate, i, b)), apart[i], apart[i + 1]))
        for end in range(i, i + 2):
            if rate[end, b] > 1e-9:
                cap[end] = min(cap[end], (allowed / rate[end, b]) ** 2)


@leaf
def _rates(arm, q, d1, rotation, translation, scratch, rate):  # type: ignore[no-untyped-def]
    """Frames of all samples, and :func:`_body_rates` at them."""
    for i in range(len(q)):
        forward_kinematics(arm.chain, q[i], rotation[i], translation[i])
        _body_rates(arm, d1[i], rotation[i], translation[i], scratch, rate[i])


@kernel
def speed_caps(arm, reach, cells, law, s, q, d1, speed, cap):  # type: ignore[no-untyped-def]
    """Lower ``cap`` (N,), bounds of (ds/dt)^2 at samples of a path, to what ``law`` allows each moving body at its separation from cells.

    Between two samples a body may be nearer than at either, by half of what it moves beyond their difference: a sample's bound takes in
    both of its pieces. Where ``speed`` needs no more room than there is, nothing is bounded, and mostly nothing looked at.

    Args:
        reach: grids that reach beyond the fine ones.
        s: (N,) path parameters. q, d1: (N, J) points of the path and its derivative by ``s``.
        speed: (N,) ds/dt that the motion has at the most: the one that it has where nothing bounds it.
    """
    n, n_joints, n_bodies = len(s), q.shape[1], len(arm.moving)
    if len(cells.centre_m) == 0:
        return
    rotation, translation = np.empty((n, n_joints + 1, 3, 3)), np.empty((n, n_joints + 1, 3))
    rate, apart, bound = np.empty((n, n_bodies)), np.empty(n), speed.copy()
    _rates(arm, q, d1, rotation, translation, np.empty((2 * n_joints + 3, 3)), rate)
    for b in range(n_bodies - 1, -1, -1):  # from the tool, the fastest: where it is slowed, others need less room
        if arm.moving[b]:
            _cap_body(arm, reach, cells, law, s, b, rate, bound, rotation, translation, apart, cap)
            for i in range(n):
                bound[i] = min(bound[i], math.sqrt(cap[i]))


@kernel
def caps_among(caps, s, q, d1, speed, cap):  # type: ignore[no-untyped-def]
    """Fill ``cap`` (N,) with the bounds by what stands and by what may move; ``caps``: :class:`services.planner.core.separation.Caps`."""
    cap[:] = np.inf
    speed_caps(caps.arm, caps.reach, caps.standing, caps.standing_law, s, q, d1, speed, cap)
    speed_caps(caps.arm, caps.reach, caps.moving, caps.moving_law, s, q, d1, speed, cap)
