"""Time-optimal timing of a sampled path under joint velocity and acceleration limits: one backward and one forward pass.

Reachability analysis as in TOPP-RA (Pham and Pham 2018, IEEE T-RO 34(3)): with x = (ds/dt)^2 and u = d2s/dt2 all limits are linear,
the largest controllable x of each grid point follows from the next one, and the fastest motion takes the largest u that stays
controllable. Limits are enforced at both ends of each grid interval (the paper's interpolation scheme).
Referee: the toppra wheel (``tests/unit/planner``).
"""

from __future__ import annotations

import math

import numpy as np

from common.kernel import copy_row, kernel, leaf
from common.robot.rates import hermite_rates
from services.planner.kernels.separation import caps_among

__all__ = ["CANNOT_ENTER", "astray", "fastest_profile", "fastest_under_caps", "fastest_within"]

CANNOT_ENTER = -1
TINY = 1e-12
ROUNDING = 1e-6  # a motion at its limit is not over it
LEAST_SPEED_SHARE = 0.9  # of the speed limits, however much those of acceleration are tightened; our choice
SLACK = 1e-9  # of rad/s^2; rounding must not make a touching pair of constraints infeasible


@leaf
def _bounds_of_u(x, d1, d2, e1, e2, limit, delta, x_next_max):  # type: ignore[no-untyped-def]
    """Tightest lower and upper line of u at ``x``: (low, slope of low, high, slope of high).

    ``d1, d2``: first and second derivative (J,) of the path at the grid point, ``e1, e2`` at the next one; ``limit`` (J,) rad/s^2.
    """
    # 0 <= x + 2 delta u <= x_next_max
    low, low_slope = -x / (2.0 * delta), -1.0 / (2.0 * delta)
    high, high_slope = (x_next_max - x) / (2.0 * delta), -1.0 / (2.0 * delta)
    for j in range(len(limit)):
        for end in range(2):
            # |gain u + bend x| <= limit
            if end == 0:
                gain, bend = d1[j], d2[j]
            else:
                gain, bend = e1[j] + 2.0 * delta * e2[j], e2[j]
            if abs(gain) < TINY:
                continue
            slope = -bend / gain
            half = limit[j] / abs(gain)
            centre = slope * x
            if centre + half < high:
                high, high_slope = centre + half, slope
            if centre - half > low:
                low, low_slope = centre - half, slope
    return low, low_slope, high, high_slope


@leaf
def _x_max(d1, d2, velocity, acceleration):  # type: ignore[no-untyped-def]
    """Largest x that the velocity limits allow, and the acceleration limits where a joint's path stands still (d1 = 0)."""
    x = np.inf
    for j in range(len(velocity)):
        if abs(d1[j]) > TINY:
            x = min(x, (velocity[j] / d1[j]) ** 2)
        elif abs(d2[j]) > TINY:
            x = min(x, acceleration[j] / abs(d2[j]))
    return x


@leaf
def _soften(s, d1, d2, d2_before, acceleration, speed_start, cap, soft):  # type: ignore[no-untyped-def]
    """Fill ``soft`` (N,) with ``cap`` (N,), raised where the motion that brakes as hard as it can from the start is still above it."""
    copy_row(cap, soft)
    x = speed_start * speed_start
    for i in range(len(s)):
        if x <= cap[i]:
            return
        soft[i] = x * (1.0 + 1e-6)
        if i + 1 < len(s):
            delta = s[i + 1] - s[i]
            low, _, _, _ = _bounds_of_u(x, d1[i], d2[i], d1[i + 1], d2_before[i + 1], acceleration, delta, np.inf)
            x = max(x + 2.0 * delta * low, 0.0)


@leaf
def fastest_profile(s, d1, d2, d2_before, velocity, acceleration, cap, speed_start, x, upper, time):  # type: ignore[no-untyped-def]
    """Squared path speed and time at grid points of the fastest motion that starts at ``speed_start`` and ends at rest.

    Args:
        s: (N,) increasing path parameters. d1, d2: (N, J) derivatives of the path by s; ``d2_before`` (N, J): the second one just before
            each point, for paths on which it jumps.
        velocity, acceleration: (J,) limits.
        cap: (N,) bounds of (ds/dt)^2 besides; infinite: none. A start that is above is braked as hard as the limits allow.
        speed_start: ds/dt at the first grid point.
        x, time: (N,) out. upper: (N,) scratch, on return the largest controllable x.

    Returns:
        True; False when the start is too fast for what follows.
    """
    n = len(s)
    _soften(s, d1, d2, d2_before, acceleration, speed_start, cap, x)
    upper[n - 1] = 0.0
    for i in range(n - 2, -1, -1):
        delta = s[i + 1] - s[i]
        x_try = min(_x_max(d1[i], d2[i], velocity, acceleration), x[i])
        # The feasible interval of u shrinks concavely with x: follow the two active lines to where they meet.
        for _ in range(50):
            low, low_slope, high, high_slope = _bounds_of_u(
                x_try, d1[i], d2[i], d1[i + 1], d2_before[i + 1], acceleration, delta, upper[i + 1]
            )
            if low <= high + SLACK:
                break
            if low_slope - high_slope < TINY:
                x_try = 0.0
                break
            x_try = max(0.0, x_try - (low - high) / (low_slope - high_slope))
        upper[i] = x_try
    x[0] = speed_start * speed_start
    if x[0] > upper[0] * (1.0 + 1e-6) + TINY:
        return False
    time[0] = 0.0
    for i in range(n - 1):
        delta = s[i + 1] - s[i]
        low, _, high, _ = _bounds_of_u(x[i], d1[i], d2[i], d1[i + 1], d2_before[i + 1], acceleration, delta, upper[i + 1])
        u = max(high, low) if high >= low - 1e-6 * abs(low) - SLACK else low
        x[i + 1] = min(max(x[i] + 2.0 * delta * u, 0.0), upper[i + 1])
        speeds = math.sqrt(x[i]) + math.sqrt(x[i + 1])
        if speeds < 1e-9:
            return False
        time[i + 1] = time[i] + 2.0 * delta / speeds
    return True


@kernel
def fastest_within(  # type: ignore[no-untyped-def]
    s, q, d1, d2, d2_before, velocity, acceleration, cap, dq_start, factors, speed, upper, time, dq, astray_rad
):
    """:func:`fastest_profile` at the first of ``factors`` at which the Hermite curve through the samples keeps the limits between them too.

    Args:
        q: (N, J) points of the path. dq_start: (J,) velocity at the first, along the path.
        factors: (F,) of the acceleration limits, falling.
        speed: (N,) out: ds/dt that no motion under a lower ``cap`` exceeds; it may get along with less tightening.
        upper: (N,) scratch. time: (N,) out. dq: (N, J) out: velocities at the samples.
        astray_rad: (J,) out, of :func:`astray`.

    Returns:
        Index of the factor; F: none is small enough; ``CANNOT_ENTER``.
    """
    n_joints, x = len(velocity), speed
    fastest, hardest = np.empty(n_joints), np.empty(n_joints)
    along, length2 = 0.0, 0.0
    for j in range(n_joints):
        along, length2 = along + dq_start[j] * d1[0, j], length2 + d1[0, j] * d1[0, j]
    speed_start = along / max(length2, TINY)
    for f in range(len(factors)):
        slower, softer = velocity * max(factors[f], LEAST_SPEED_SHARE), acceleration * factors[f]
        if not fastest_profile(s, d1, d2, d2_before, slower, softer, cap, speed_start, x, upper, time):
            return CANNOT_ENTER
        dq[0] = dq_start
        for i in range(1, len(s)):
            here = math.sqrt(x[i])
            for j in range(n_joints):
                dq[i, j] = d1[i, j] * here
        hermite_rates(time, q, dq, fastest, hardest)
        kept = True
        for j in range(n_joints):
            kept = kept and max(fastest[j] / velocity[j], hardest[j] / acceleration[j]) <= 1.0 + ROUNDING
        if kept:
            astray(s, x, time, d2, astray_rad)
            for i in range(len(s)):
                speed[i] = math.sqrt(x[i]) / factors[f]
            return f
    return len(factors)


@kernel
def fastest_under_caps(  # type: ignore[no-untyped-def]
    s, q, d1, d2, d2_before, velocity, acceleration, caps, dq_start, factors, cap, speed, upper, time, dq, astray_rad
):
    """:func:`fastest_within` no faster than ``caps`` allow where that motion would be faster; by itself where under them there is none.

    To get out of a way that is blocked counts more than to be slow.

    Args:
        caps: :class:`services.planner.core.separation.Caps`.
        cap: (N,) out: what they allow. The others as for :func:`fastest_within`.
    """
    cap[:] = np.inf
    k = fastest_within(s, q, d1, d2, d2_before, velocity, acceleration, cap, dq_start, factors, speed, upper, time, dq, astray_rad)
    if k in (CANNOT_ENTER, len(factors)):
        return k
    caps_among(caps, s, q, d1, speed, cap)
    is_bounded = False
    for i in range(len(s)):
        is_bounded = is_bounded or speed[i] * speed[i] > cap[i]
    if not is_bounded:
        return k
    free_time, free_dq, free_astray_rad = time.copy(), dq.copy(), astray_rad.copy()
    capped = fastest_within(s, q, d1, d2, d2_before, velocity, acceleration, cap, dq_start, factors, speed, upper, time, dq, astray_rad)
    if capped in (CANNOT_ENTER, len(factors)):
        time[:], dq[:], astray_rad[:] = free_time, free_dq, free_astray_rad
        return k
    return capped


@leaf
def astray(s, x, time, d2, most_rad):  # type: ignore[no-untyped-def]
    """Fill ``most_rad`` (J,): how far the cubic between knots may be from the path, where that is a parabola of ``s`` between them.

    With d2s/dt2 = a there, the fourth derivative of the joint by time is 3 a^2 d2, and a cubic Hermite interpolant over a time h is off by
    h^4 / 384 times that at most (Burden and Faires, Numerical Analysis, theorem 3.9). Where the path is straight it is exact.
    """
    most_rad[:] = 0.0
    for i in range(len(s) - 1):
        a, h = (x[i + 1] - x[i]) / (2.0 * (s[i + 1] - s[i])), time[i + 1] - time[i]
        share = h**4 * a * a / 128.0
        for j in range(len(most_rad)):
            most_rad[j] = max(most_rad[j], share * abs(d2[i, j]))
