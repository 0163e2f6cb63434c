from __future__ import annotations

import itertools

import numpy as np
import pytest
import toppra
from toppra.interpolator import AbstractGeometricPath

from common.robot.trajectory import JointTrajectory
from services.planner.core.smoothing import Nurbs, candidates
from services.planner.core.timing import Limits, brake, limit_ratio, time_curve, time_polyline

LIMITS = Limits(np.array([2.16, 2.16, 3.15, 3.2, 3.2, 3.2]), np.full(6, 5.0))
toppra.setup_logging("ERROR")


def _path(seed, n=12):
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.normal(scale=0.08, size=(n, 6)) + np.array([0.12, 0.02, -0.03, 0.05, 0.0, 0.0]), axis=0)


class _ToppraPath(AbstractGeometricPath):
    def __init__(self, curve):
        self._curve = curve

    def __call__(self, path_positions, order=0):
        s = np.atleast_1d(np.asarray(path_positions, dtype=float))
        out = self._curve.derivatives(s)[order]
        return out[0] if np.ndim(path_positions) == 0 else out

    dof = 6
    path_interval = np.array([0.0, 1.0])

    @property
    def waypoints(self):
        s = np.linspace(0, 1, 10)
        return s, self._curve(s)


@pytest.mark.parametrize("seed", range(6))
def test_nearly_as_fast_as_toppra(seed):
    """The referee: the toppra wheel on the same curve, limits and a fine grid."""
    curve = next(iter(candidates(_path(seed), lead_in=False)))
    mine = time_curve(curve, LIMITS)
    constraints = [
        toppra.constraint.JointVelocityConstraint(np.stack([-LIMITS.velocity, LIMITS.velocity], axis=1)),
        toppra.constraint.JointAccelerationConstraint(np.stack([-LIMITS.acceleration, LIMITS.acceleration], axis=1)),
    ]
    solver = toppra.algorithm.TOPPRA(
        constraints, _ToppraPath(curve), gridpoints=np.linspace(0, 1, 301), parametrizer="ParametrizeConstAccel"
    )
    best = solver.compute_trajectory(0, 0).duration
    assert mine is not None
    assert 0.98 * best <= mine.duration_s <= 1.15 * best  # the Hermite curve between our knots must keep the limits too


@pytest.mark.parametrize("seed", range(20))
def test_limits_hold_on_the_curve_between_the_knots(seed):
    for curve in candidates(_path(seed), lead_in=False):
        timed = time_curve(curve, LIMITS)
        if timed is None:
            continue
        t = np.linspace(0.0, timed.duration_s, 3000)
        _, dq, ddq = timed.sample(t)
        assert np.all(np.abs(dq) <= LIMITS.velocity * (1 + 1e-5))
        assert np.all(np.abs(ddq) <= LIMITS.acceleration * (1 + 1e-5))
        assert timed.q_rad[0] == pytest.approx(curve(np.zeros(1))[0]) and timed.q_rad[-1] == pytest.approx(curve(np.ones(1))[0])
        assert not timed.dq_rad_s[[0, -1]].any()


def test_a_straight_line_takes_the_textbook_time():
    # One joint, 1 rad at 5 rad/s^2 and 2.16 rad/s: accelerate 0.432 s, cruise, brake. T = d / v + v / a.
    line = Nurbs.of(np.array([[0.0] * 6, [1.0, 0, 0, 0, 0, 0]]), 1, 1.0, "line")
    timed = time_curve(line, LIMITS)
    assert timed.duration_s == pytest.approx(1 / 2.16 + 2.16 / 5, rel=0.02)


def test_leaving_with_a_velocity():
    velocity = np.array([0.8, 0.2, -0.1, 0.3, 0.0, 0.0])
    line = Nurbs.of(np.stack([np.zeros(6), velocity]), 1, 1.0, "line")
    timed = time_curve(line, LIMITS, velocity)
    assert timed.dq_rad_s[0] == pytest.approx(velocity)
    assert limit_ratio(timed, LIMITS) <= 1.0 + 1e-5
    too_short = Nurbs.of(np.stack([np.zeros(6), velocity * 0.02]), 1, 1.0, "line")
    assert time_curve(too_short, LIMITS, velocity) is None


@pytest.mark.parametrize("seed", range(10))
def test_a_straight_way_is_timed_as_the_general_timing_does_it(seed):
    rng = np.random.default_rng(seed)
    way, share = rng.normal(scale=0.5, size=6), rng.uniform(0, 0.9)
    line = Nurbs.of(np.stack([np.zeros(6), way]), 1, 1.0, "line")
    fastest = np.sqrt(2 * np.min(LIMITS.acceleration / np.abs(way)))  # from which it can just stop within the way
    velocity = way * min(share * fastest, np.min(LIMITS.velocity / np.abs(way))) if seed % 2 else None
    timed, corner_s = time_polyline(np.stack([np.zeros(6), way]), LIMITS, velocity)
    assert limit_ratio(timed, LIMITS) <= 1.0 + 1e-6
    assert timed.duration_s == corner_s[-1] <= time_curve(line, LIMITS, velocity).duration_s * (1 + 1e-6)
    assert timed.dq_rad_s[0] == pytest.approx(np.zeros(6) if velocity is None else velocity)


def test_a_way_too_short_to_stop_in_is_not_entered():
    way = np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert time_polyline(np.stack([np.zeros(6), way]), LIMITS, way / 0.05) is None


def test_a_polyline_stops_at_each_corner():
    path = _path(3, 5)
    timed, corner_s = time_polyline(path, LIMITS)
    assert timed.sample(corner_s)[0] == pytest.approx(path)
    assert limit_ratio(timed, LIMITS) <= 1.0 + 1e-5
    for corner in path:
        k = int(np.argmin(np.linalg.norm(timed.q_rad - corner, axis=1)))
        assert timed.q_rad[k] == pytest.approx(corner) and not timed.dq_rad_s[k].any()
    # and between corners it is on the straight line
    for q in timed.sample(np.linspace(0, timed.duration_s, 500))[0]:
        gaps = []
        for a, b in itertools.pairwise(path):
            u = np.clip((q - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
            gaps.append(np.linalg.norm(q - a - u * (b - a)))
        assert min(gaps) < 1e-6


@pytest.mark.parametrize("seed", range(10))
def test_braking_stays_on_the_way_and_within_limits(seed):
    curve = next(iter(candidates(_path(seed), lead_in=False)))
    running = time_curve(curve, LIMITS.scaled(0.8, 0.9))
    at = running.duration_s * 0.5
    stop = brake(running, at, LIMITS, within_s=0.05)
    assert limit_ratio(stop, LIMITS) <= 1.0 + 1e-5
    q, dq, _ = running.sample(at)
    assert stop.q_rad[0] == pytest.approx(q) and stop.dq_rad_s[0] == pytest.approx(dq)
    assert not stop.dq_rad_s[-1].any()
    way = running.sample(np.linspace(at, running.duration_s, 4000))[0]
    for q in stop.sample(np.linspace(0, stop.duration_s, 50))[0]:
        assert np.linalg.norm(way - q, axis=1).min() < 2e-3


def test_braking_uses_the_room_there_is():
    running = time_curve(Nurbs.of(np.array([[0.0] * 6, [2.0, 0, 0, 0, 0, 0]]), 1, 1.0, "line"), LIMITS)
    hard, gentle = brake(running, 0.6, LIMITS, within_s=0.01), brake(running, 0.6, LIMITS, within_s=5.0)
    assert hard.duration_s < gentle.duration_s
    assert hard.duration_s <= 2.16 / 5 * 1.15


def test_limit_ratio_sees_a_peak_between_knots():
    # From rest to rest in one piece: the velocity peaks in the middle at 1.5 times the mean.
    piece = JointTrajectory(np.array([0.0, 1.0]), np.array([[0.0] * 6, [2.0] + [0.0] * 5]), np.zeros((2, 6)))
    assert limit_ratio(piece, Limits(np.full(6, 3.0), np.full(6, 1e9))) == pytest.approx(1.0)
    assert limit_ratio(piece, Limits(np.full(6, 1e9), np.full(6, 12.0))) == pytest.approx(1.0)
