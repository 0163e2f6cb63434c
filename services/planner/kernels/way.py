"""Whether a whole way is free, looked at from the coarse to the fine: most of what is blocked shows at the middle or the quarters.

A look at a pose tells of each body how far it may move until it could touch a cell or the static layer, and of each pair until it could
touch one another (:mod:`services.planner.kernels.collision`). Between two poses that were looked at, what cannot move far enough to use up
the room that it has at both needs no look (Schwarzer, Saha and Latombe 2005, "Adaptive dynamic collision checking", IEEE T-RO 21(3)).
Where that does not decide, the way is halved, until its poses are so close together that no point of the arm moves more than ``step_m``.

Twin: every pose of the finest step by itself (``tests/unit/planner/test_way.py``).
"""

from __future__ import annotations

import numpy as np

from common.kernel import kernel, leaf
from common.robot.kernels import forward_kinematics
from services.planner.kernels.body_cells import body_cell_gap
from services.planner.kernels.collision import pair_gap, tabled_gap
from services.planner.kernels.moves import parabola_moves, segment_moves
from services.planner.kernels.static_layer import body_static_gap

__all__ = ["line_between_is_free", "line_is_free", "new_rooms", "parabola_is_free", "pose_room"]


@kernel
def new_rooms(arm, n):  # type: ignore[no-untyped-def]
    """(n, 2 B + P) the rooms of ``n`` poses that were not looked at yet; see :func:`line_between_is_free`."""
    return np.full((n, 2 * len(arm.moving) + len(arm.pairs)), np.nan)


@kernel
def pose_room(arm, solids, cells, safety_m, q, room):  # type: ignore[no-untyped-def]
    """Whether a pose (J,) is free; if so, ``room`` (2 B + P,) tells how far each body and pair may move until it could touch anything."""
    rotation, translation = np.empty((len(q) + 1, 3, 3)), np.empty((len(q) + 1, 3))
    still, at, look = np.zeros(len(q)), np.empty(len(q)), np.ones(len(room), dtype=np.bool_)
    if _looks_free(arm, solids, cells, safety_m, q, still, still, 0.0, at, look, room, rotation, translation):
        return True
    room[0] = np.nan
    return False


@kernel
def line_is_free(arm, solids, cells, safety_m, step_m, q_a, q_b):  # type: ignore[no-untyped-def]
    """Whether the straight joint segment from ``q_a`` to ``q_b`` (J,) is free, both ends included."""
    room = new_rooms(arm, 2)
    for k in range(2):
        if not pose_room(arm, solids, cells, safety_m, q_a if k else q_b, room[k]):
            return False
    return line_between_is_free(arm, solids, cells, safety_m, step_m, q_a, q_b, room[1], room[0])


@kernel
def line_between_is_free(arm, solids, cells, safety_m, step_m, q_a, q_b, room_a, room_b):  # type: ignore[no-untyped-def]
    """Whether the straight joint segment between two poses that are free is free.

    Args:
        q_a, q_b: (J,) its ends.
        room_a, room_b: (2 B + P,) their rooms as :func:`pose_room` fills them, or NaN in the first place where that end was not looked at
            yet; filled then if it has to be, for others that begin or end there. The middle is looked at first then: what is blocked
            mostly shows there.
    """
    n_joints, n_bodies, n_items = len(q_a), len(arm.moving), len(room_a)
    rotation, translation = np.empty((2, n_joints + 1, 3, 3)), np.empty((2, n_joints + 1, 3))
    leg, turned, body_m, bend = q_b - q_a, np.empty(n_joints), np.empty(n_bodies), np.zeros(n_joints)
    n_steps = segment_moves(arm, q_a, leg, step_m, body_m, rotation, translation)
    for j in range(n_joints):
        turned[j] = abs(leg[j]) / n_steps
    moved = np.empty(n_items)
    _most_moved(arm, turned, body_m, moved)
    room, look, q = np.empty((n_steps + 1, n_items)), np.ones(n_items, dtype=np.bool_), np.empty(n_joints)
    room[:, 0] = np.nan
    middle = n_steps // 2
    if middle > 0 and np.isnan(room_a[0] + room_b[0]):
        u = middle / n_steps
        if not _looks_free(arm, solids, cells, safety_m, q_a, leg, bend, u, q, look, room[middle], rotation[0], translation[0]):
            return False
    for q_end, room_end in ((q_a, room_a), (q_b, room_b)):
        if np.isnan(room_end[0]) and not pose_room(arm, solids, cells, safety_m, q_end, room_end):
            return False
    room[0], room[n_steps] = room_a, room_b
    waiting = np.empty((n_steps + 1, 2), dtype=np.int64)
    way = q_a, leg, bend, n_steps
    return _is_free(arm, solids, cells, safety_m, way, moved, room, q, look, waiting, rotation[0], translation[0])


@kernel
def parabola_is_free(arm, solids, cells, safety_m, step_m, q_a, leg_in, leg_out):  # type: ignore[no-untyped-def]
    """Whether the parabola that leaves ``q_a`` (J,) along ``leg_in`` and ends along ``leg_out`` after it is free.

    The quadratic Bezier curve with control points q_a, q_a + leg_in, q_a + leg_in + leg_out.
    """
    n_joints, n_bodies = len(q_a), len(arm.moving)
    rotation, translation = np.empty((2, n_joints + 1, 3, 3)), np.empty((2, n_joints + 1, 3))
    turned, slope, bend, body_m = np.empty(n_joints), np.empty(n_joints), np.empty(n_joints), np.empty(n_bodies)
    n_steps = parabola_moves(arm, q_a, leg_in, leg_out, step_m, body_m, rotation, translation)
    for j in range(n_joints):
        slope[j], bend[j] = 2.0 * leg_in[j], leg_out[j] - leg_in[j]
        turned[j] = 2.0 * max(abs(leg_in[j]), abs(leg_out[j])) / n_steps  # no joint turns faster than twice the longer leg
    moved = np.empty(2 * n_bodies + len(arm.pairs))
    _most_moved(arm, turned, body_m, moved)
    room, look, q = np.empty((n_steps + 1, len(moved))), np.ones(len(moved), dtype=np.bool_), np.empty(n_joints)
    room[:, 0] = np.nan
    for end in (n_steps, 0):
        u = end / n_steps
        if not _looks_free(arm, solids, cells, safety_m, q_a, slope, bend, u, q, look, room[end], rotation[0], translation[0]):
            return False
    waiting = np.empty((n_steps + 1, 2), dtype=np.int64)
    way = q_a, slope, bend, n_steps
    return _is_free(arm, solids, cells, safety_m, way, moved, room, q, look, waiting, rotation[0], translation[0])


@leaf
def _most_moved(arm, turned, body_m, moved):  # type: ignore[no-untyped-def]
    """Fill ``moved`` (2 B + P,): how far each body, once against cells and once against the static layer, and each pair may move in a step.

    ``turned`` (J,) rad in a step; ``body_m`` (B,) what each body's points do not outrun in a step.
    """
    n_bodies, n_pairs = len(arm.moving), len(arm.pairs)
    moved[:] = 0.0
    for b in range(n_bodies):
        if arm.moving[b]:
            for j in range(len(turned)):
                moved[b] += turned[j] * arm.lever_m[b, j]
            moved[b] = min(moved[b], body_m[b])
            moved[n_bodies + b] = moved[b]
    for p in range(n_pairs):
        for j in range(len(turned)):
            moved[2 * n_bodies + p] += turned[j] * arm.pair_lever_m[p, j]
        apart = moved[arm.pairs[p, 0]] + moved[arm.pairs[p, 1]]
        moved[2 * n_bodies + p] = min(moved[2 * n_bodies + p], apart)


@leaf
def _is_free(arm, solids, cells, safety_m, way, moved, room, q, look, waiting, rotation, translation):  # type: ignore[no-untyped-def]
    """Whether ``q_a + u slope + u^2 bend`` is free at u = 1 / n_steps, 2 / n_steps, ...; its ends are.

    Args:
        way: (q_a, slope, bend, n_steps).
        moved: see :func:`_most_moved`.
        room: (n_steps + 1, len(moved)) filled at both ends and where it was looked already, else NaN in the first place.
        q, look, waiting, rotation, translation: scratch, (J,), (len(moved),), (n_steps + 1, 2) and frames.
    """
    q_a, slope, bend, n_steps = way
    n_items, n_waiting, first = len(moved), 0, 0  # fewer than n_steps pieces have something in between
    if n_steps > 1:
        waiting[0, 0], waiting[0, 1], n_waiting = 0, n_steps, 1
    while first < n_waiting:  # first in, first out: all halves before any quarter
        low, high = waiting[first, 0], waiting[first, 1]
        first += 1
        middle = (low + high) // 2
        if np.isnan(room[middle, 0]):
            undecided = False
            for i in range(n_items):
                look[i] = room[low, i] + room[high, i] <= moved[i] * (high - low)
                undecided = undecided or look[i]
            if not undecided:
                continue
            for i in range(n_items):
                if not look[i]:
                    room[middle, i] = max(room[low, i] - moved[i] * (middle - low), room[high, i] - moved[i] * (high - middle))
            u = middle / n_steps
            if not _looks_free(arm, solids, cells, safety_m, q_a, slope, bend, u, q, look, room[middle], rotation, translation):
                return False
        for begin, end in ((low, middle), (middle, high)):
            if end - begin > 1:
                waiting[n_waiting, 0], waiting[n_waiting, 1] = begin, end
                n_waiting += 1
    return True


@leaf
def _looks_free(arm, solids, cells, safety_m, q_a, slope, bend, u, q, look, room, rotation, translation):  # type: ignore[no-untyped-def]
    """Look at the pose at ``u`` for the items in ``look`` and fill their ``room``; False as soon as one has none."""
    grids, n_bodies = arm.grids, len(arm.moving)
    for j in range(len(q)):
        q[j] = q_a[j] + u * (slope[j] + u * bend[j])
    needs_frames = False
    for i in range(len(look)):
        if look[i]:
            p = i - 2 * n_bodies
            room[i] = tabled_gap(arm, p, q) if p >= 0 else (0.0 if arm.moving[i % n_bodies] else np.inf)
            needs_frames = needs_frames or room[i] <= 0.0
    if not needs_frames:
        return True
    forward_kinematics(arm.chain, q, rotation, translation)
    for i in range(len(look)):
        if not look[i] or room[i] > 0.0:
            continue
        if i >= 2 * n_bodies:
            room[i] = pair_gap(arm, i - 2 * n_bodies, rotation, translation)
        else:
            b = i % n_bodies
            turn, shift = rotation[grids.body_joint[b]], translation[grids.body_joint[b]]
            if i < n_bodies:
                hit, room[i] = body_cell_gap(arm, cells, b, safety_m, turn, shift)
            else:
                room[i], hit = body_static_gap(grids, solids, b, turn, shift, arm.static_margin_m)
            if hit >= 0:
                return False
        if i >= 2 * n_bodies and room[i] <= 0.0:
            return False
    return True
