"""How far the points of the arm move along a way, and so how many steps it is looked at in."""

from __future__ import annotations

import math

import numpy as np

from common.kernel import inlined, kernel, leaf
from common.robot.kernels import forward_kinematics

__all__ = ["displacement_m", "parabola_moves", "segment_moves", "segment_steps"]

PIECE_RAD = 0.25  # see segment_moves


@inlined
def displacement_m(arm, b, rotation_a, translation_a, rotation_b, translation_b):  # type: ignore[no-untyped-def]
    """Farthest in metres that any point of body ``b`` is apart in two poses, given by their frames.

    A body's points are mapped by one affine map, so none moves farther than the farthest corner of the body's box.
    """
    grids = arm.grids
    low, high = grids.box_min_m, grids.box_max_m
    j = grids.body_joint[b]
    ra, ta, rb, tb = rotation_a[j], translation_a[j], rotation_b[j], translation_b[j]
    largest2 = 0.0
    for corner in range(8):
        x = high[b, 0] if corner & 1 else low[b, 0]
        y = high[b, 1] if corner & 2 else low[b, 1]
        z = high[b, 2] if corner & 4 else low[b, 2]
        d2 = 0.0
        for r in range(3):
            d = tb[r] - ta[r] + (rb[r, 0] - ra[r, 0]) * x + (rb[r, 1] - ra[r, 1]) * y + (rb[r, 2] - ra[r, 2]) * z
            d2 += d * d
        largest2 = max(largest2, d2)
    return math.sqrt(largest2)


@kernel
def segment_steps(arm, q_a, dq, step_m, rotation, translation):  # type: ignore[no-untyped-def]
    """Number of equal steps of the joint segment from ``q_a`` by ``dq`` such that no point of the arm moves more than ``step_m`` a step.

    ``rotation, translation``: scratch (2, J + 1, ...).
    """
    return segment_moves(arm, q_a, dq, step_m, np.empty(len(arm.moving)), rotation, translation)


@kernel
def segment_moves(arm, q_a, dq, step_m, body_m, rotation, translation):  # type: ignore[no-untyped-def]
    """:func:`segment_steps`, and ``body_m`` (B,): what no point of each moving body outruns in a step.

    Displacements are taken over pieces in which no joint turns by more than ``PIECE_RAD``; a chord of such a piece is within 1 % of its
    arc, and a twentieth is added for motions that vary within it.
    """
    largest = 0.0
    for j in range(len(dq)):
        largest = max(largest, abs(dq[j]))
    n_pieces = max(1, math.ceil(largest / PIECE_RAD))
    return _segment_moves(arm, q_a, dq, n_pieces, step_m, body_m, np.empty(len(dq)), rotation, translation)


@leaf
def _segment_moves(arm, q_a, dq, n_pieces, step_m, body_m, q, rotation, translation):  # type: ignore[no-untyped-def]
    """:func:`segment_moves` over ``n_pieces``; ``q`` (J,): scratch."""
    forward_kinematics(arm.chain, q_a, rotation[0], translation[0])
    body_m[:] = 0.0
    for piece in range(1, n_pieces + 1):
        for j in range(len(dq)):
            q[j] = q_a[j] + dq[j] * (piece / n_pieces)
        now, before = piece & 1, 1 - (piece & 1)
        forward_kinematics(arm.chain, q, rotation[now], translation[now])
        for b in range(len(arm.moving)):
            if arm.moving[b]:
                moved_m = displacement_m(arm, b, rotation[before], translation[before], rotation[now], translation[now])
                body_m[b] = max(body_m[b], moved_m)
    farthest = 0.0
    for b in range(len(arm.moving)):
        farthest = max(farthest, body_m[b])
    n_steps = n_pieces * max(1, math.ceil(1.05 * farthest / step_m))
    for b in range(len(arm.moving)):
        body_m[b] *= 1.05 * n_pieces / n_steps
    return n_steps


@kernel
def parabola_moves(arm, q_a, leg_in, leg_out, step_m, body_m, rotation, translation):  # type: ignore[no-untyped-def]
    """:func:`segment_moves` for the parabola that leaves ``q_a`` (J,) along ``leg_in`` and ends along ``leg_out`` after it.

    Its direction is a mean of the two legs everywhere, times two: displacements along either leg are taken at poses along the parabola
    that are no more than about ``PIECE_RAD`` apart.
    """
    largest = 0.0
    for j in range(len(q_a)):
        largest = max(largest, abs(leg_in[j]), abs(leg_out[j]))
    n_pieces = max(1, math.ceil(2.0 * largest / PIECE_RAD))
    share = min(1.0, 0.5 * PIECE_RAD / largest) if largest > 0.0 else 1.0
    scratch_rad = np.empty((2, len(q_a)))
    return _parabola_moves(arm, q_a, leg_in, leg_out, n_pieces, share, step_m, body_m, scratch_rad, rotation, translation)


@leaf
def _parabola_moves(arm, q_a, leg_in, leg_out, n_pieces, share, step_m, body_m, scratch_rad, rotation, translation):  # type: ignore[no-untyped-def]
    """:func:`parabola_moves` over ``n_pieces``, along ``share`` of the legs; ``scratch_rad`` (2, J)."""
    q, q_on = scratch_rad[0], scratch_rad[1]
    body_m[:] = 0.0
    for piece in range(n_pieces):
        u = (piece + 0.5) / n_pieces
        for j in range(len(q)):
            q[j] = q_a[j] + u * (2.0 * leg_in[j] + u * (leg_out[j] - leg_in[j]))
        forward_kinematics(arm.chain, q, rotation[0], translation[0])
        for leg in (leg_in, leg_out):
            for j in range(len(q)):
                q_on[j] = q[j] + share * leg[j]
            forward_kinematics(arm.chain, q_on, rotation[1], translation[1])
            for b in range(len(arm.moving)):
                if arm.moving[b]:
                    moved_m = displacement_m(arm, b, rotation[0], translation[0], rotation[1], translation[1])
                    body_m[b] = max(body_m[b], 2.0 * moved_m / share)
    farthest = 0.0
    for b in range(len(arm.moving)):
        farthest = max(farthest, body_m[b])
    n_steps = max(1, math.ceil(1.05 * farthest / step_m))
    for b in range(len(arm.moving)):
        body_m[b] *= 1.05 / n_steps
    return n_steps
