"""Corners rounded one by one: each by the largest parabola that is free.

A path of straight pieces, free as they are, becomes a NURBS of degree 2 whose control points lie on it: at a corner the curve leaves the
line ``reach`` before it and joins the next line ``reach`` after it (The NURBS Book, chapter 4: a quadratic Bezier piece). Smoothness is
lowered where it must be, not everywhere. Twin: ``tests/support/slow_blends.py``.
"""

from __future__ import annotations

import math

import numpy as np

from common.kernel import kernel, leaf
from services.planner.kernels.way import line_is_free, parabola_is_free

__all__ = ["LINE_STEP_RAD", "fit_blends", "sample_blends", "sample_count"]

SHARE_INSIDE = 0.5  # of a piece between two corners: what each of them may use
SHARE_AT_END = 0.95  # of the first and the last piece; some of the line stays, so that the ends' direction is the line's
HALVINGS = 6  # of the reach, until the corner is given up
LEAST_RAD = 1e-4  # a smaller reach is none; our choice: a slow arm's lead-in is that short, and to stop at its end would be felt
LINE_STEP_RAD, BLEND_STEP_RAD = 0.1, 0.04  # joint way between samples for timing; our choice
LEAST_SAMPLES = 4  # pieces of a blend for timing


@leaf
def _length(path, k):  # type: ignore[no-untyped-def]
    total = 0.0
    for j in range(path.shape[1]):
        total += (path[k + 1, j] - path[k, j]) ** 2
    return math.sqrt(total)


@kernel
def fit_blends(arm, blend_arm, solids, cells, safety_m, room_m, step_m, path, proven, share, reach):  # type: ignore[no-untyped-def]
    """Fill ``reach`` (P,) rad with the largest free reach of each corner of ``path`` (P, J); zero at the ends and where none is free.

    Args:
        arm, solids, cells, safety_m, step_m: as for the checks.
        blend_arm, room_m: for the blends, which keep ``room_m`` more from cells, and the margins of ``blend_arm``: what is driven may stray
            from them.
        path: no two points in a row may coincide. proven: (P - 1,) uint8, not zero: the straight piece is known to be free.
        share: of the room that a corner has on its two pieces, 0..1.

    Returns:
        The first piece of which what the blends leave is not free, or -1: the rounded path is free.
    """
    n = len(path)
    reach[:] = 0.0
    for k in range(1, n - 1):
        before, after = _length(path, k - 1), _length(path, k)
        room_before = before * (SHARE_AT_END if k == 1 else SHARE_INSIDE)
        room_after = after * (SHARE_AT_END if k == n - 2 else SHARE_INSIDE)
        wanted = share * min(room_before, room_after)
        for _ in range(HALVINGS):
            if wanted < LEAST_RAD:
                break
            if _blend_is_free(blend_arm, solids, cells, safety_m + room_m, step_m, path, k, wanted / before, wanted / after):
                reach[k] = wanted
                break
            wanted *= 0.5
    for k in range(n - 1):
        if not proven[k] and not _line_is_free(arm, solids, cells, safety_m, step_m, path, k, reach):
            return k
    return -1


@kernel
def _line_is_free(arm, solids, cells, safety_m, step_m, path, k, reach):  # type: ignore[no-untyped-def]
    """Whether what the blends leave of piece ``k`` is free."""
    length = _length(path, k)
    if reach[k] + reach[k + 1] >= length:
        return True
    way = path[k + 1] - path[k]
    q_a, q_b = path[k] + way * (reach[k] / length), path[k + 1] - way * (reach[k + 1] / length)
    return line_is_free(arm, solids, cells, safety_m, step_m, q_a, q_b)


@kernel
def _blend_is_free(arm, solids, cells, safety_m, step_m, path, k, back, ahead):  # type: ignore[no-untyped-def]
    """Whether the parabola from ``back`` of the piece before corner ``k`` to ``ahead`` of the piece after it is free."""
    leg_in, leg_out = back * (path[k] - path[k - 1]), ahead * (path[k + 1] - path[k])
    return parabola_is_free(arm, solids, cells, safety_m, step_m, path[k] - leg_in, leg_in, leg_out)


@leaf
def _pieces_of(length, step):  # type: ignore[no-untyped-def]
    return max(1, math.ceil(length / step))


@leaf
def sample_count(path, reach):  # type: ignore[no-untyped-def]
    """How many samples :func:`sample_blends` gives."""
    count = 1
    for k in range(len(path) - 1):
        line = _length(path, k) - reach[k] - reach[k + 1]
        count += _pieces_of(line, LINE_STEP_RAD) if line > 1e-9 else 0
        if reach[k + 1] > 0.0:
            count += max(LEAST_SAMPLES, _pieces_of(2.0 * reach[k + 1], BLEND_STEP_RAD))
    return count


@kernel
def sample_blends(path, reach, s, q, d1, d2, d2_before):  # type: ignore[no-untyped-def]
    """Samples of the rounded path for timing, ends of lines and blends among them.

    Args:
        path: (P, J). reach: (P,) rad, as filled by :func:`fit_blends`, above zero at every inner point.
        s: (N,) out, path parameter in rad: the way along lines, twice the reach over a blend.
        q, d1: (N, J) out, points and first derivatives by ``s`` (continuous).
        d2, d2_before: (N, J) out, second derivatives after and before each point (they differ where a line meets a blend).
    """
    n_joints = path.shape[1]
    out, at = 0, 0.0
    unit, unit_next = np.empty(n_joints), np.empty(n_joints)
    for k in range(len(path) - 1):
        length = _length(path, k)
        line = length - reach[k] - reach[k + 1]
        for j in range(n_joints):
            unit[j] = (path[k + 1, j] - path[k, j]) / length
        if k == 0:
            s[0] = 0.0
            for j in range(n_joints):
                q[0, j], d1[0, j], d2[0, j], d2_before[0, j] = path[0, j], unit[j], 0.0, 0.0
        n_line = _pieces_of(line, LINE_STEP_RAD) if line > 1e-9 else 0
        if n_line:
            for j in range(n_joints):
                d2[out, j] = 0.0
        for i in range(1, n_line + 1):
            out += 1
            along = reach[k] + line * i / n_line
            s[out] = at + line * i / n_line
            for j in range(n_joints):
                q[out, j], d1[out, j], d2[out, j], d2_before[out, j] = path[k, j] + along * unit[j], unit[j], 0.0, 0.0
        at += max(line, 0.0)
        if reach[k + 1] > 0.0:
            out = _sample_blend(path, k, reach[k + 1], unit, unit_next, at, out, s, q, d1, d2, d2_before)
            at += 2.0 * reach[k + 1]


@leaf
def _sample_blend(path, k, reach, unit, unit_next, at, out, s, q, d1, d2, d2_before):  # type: ignore[no-untyped-def]
    """The blend at corner ``k + 1``, which begins at sample ``out``; the sample at which it ends."""
    n_joints = path.shape[1]
    length_next = _length(path, k + 1)
    for j in range(n_joints):
        unit_next[j] = (path[k + 2, j] - path[k + 1, j]) / length_next
        d2[out, j] = (unit_next[j] - unit[j]) / (2.0 * reach)
    n_blend = max(LEAST_SAMPLES, _pieces_of(2.0 * reach, BLEND_STEP_RAD))
    for i in range(1, n_blend + 1):
        out += 1
        u = i / n_blend
        s[out] = at + 2.0 * reach * u
        for j in range(n_joints):
            q[out, j] = path[k + 1, j] - (1.0 - u) * (1.0 - u) * reach * unit[j] + u * u * reach * unit_next[j]
            d1[out, j] = (1.0 - u) * unit[j] + u * unit_next[j]
            d2_before[out, j] = (unit_next[j] - unit[j]) / (2.0 * reach)
            d2[out, j] = d2_before[out, j] if i < n_blend else 0.0
    return out
