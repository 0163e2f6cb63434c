"""Corners rounded one by one, corners cut."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from common.robot.trajectory import JointTrajectory
from services.planner.core.find import Pieces
from services.planner.core.timing import Limits, limit_ratio, time_blends, time_polyline
from services.planner.core.world import cells_of
from services.planner.kernels.blends import sample_blends, sample_count
from services.planner.kernels.collision import FREE
from services.planner.kernels.shorten import cut_corners
from tests.support.slow_blends import point_on_blends, reach_of_corners
from tests.support.slow_shorten import kept_corners

LIMITS = Limits(np.array([2.16, 2.16, 3.15, 3.2, 3.2, 3.2]), np.full(6, 5.0))


def _path(rng: np.random.Generator, n: int = 6) -> np.ndarray:
    return np.array([0.0, -1.4, 1.4, -1.5, -1.57, 0.0]) + np.cumsum(rng.normal(scale=0.25, size=(n, 6)), axis=0)


def _cells(bench, rng, path):
    """A few cells beside the tool's way: some corners can be rounded widely, some little."""
    middle = bench.robot.tool_pose(path[len(path) // 2])[:3, 3]
    flat = np.unique(bench.grid.cells_of(middle + rng.normal(scale=0.15, size=(6, 3))))
    return cells_of(bench.grid, flat[flat >= 0].astype(np.int32))


def _timed(path: np.ndarray, reach: np.ndarray, velocity: np.ndarray | None = None) -> JointTrajectory:
    timed = time_blends(path, reach, LIMITS, velocity)
    assert timed is not None
    return timed.curve


def _way(t_s: np.ndarray, s: np.ndarray, speed: np.ndarray, at_s: np.ndarray) -> np.ndarray:
    """Path parameter at times ``at_s`` of a motion of constant acceleration between grid points."""
    k = np.clip(np.searchsorted(t_s, at_s, side="right") - 1, 0, len(t_s) - 2)
    since, h = at_s - t_s[k], np.diff(t_s)[k]
    return s[k] + speed[k] * since + (speed[k + 1] - speed[k]) / h * since**2 / 2


@pytest.mark.parametrize("seed", range(12))
def test_a_timed_curve_strays_no_farther_from_the_rounded_path_than_it_says(seed):
    rng = np.random.default_rng(seed)
    path = _path(rng)
    lengths = np.linalg.norm(np.diff(path, axis=0), axis=1)
    reach = np.zeros(len(path))
    reach[1:-1] = np.minimum(lengths[:-1], lengths[1:]) * rng.uniform(0.02, 0.5, size=4)
    timed = time_blends(path, reach, LIMITS)
    assert timed is not None
    n = sample_count(path, reach)
    s, (q, d1, d2, d2_before) = np.empty(n), np.empty((4, n, 6))
    sample_blends(path, reach, s, q, d1, d2, d2_before)
    assert n == len(timed.curve.t_s)
    speed = np.linalg.norm(timed.curve.dq_rad_s, axis=1) / np.linalg.norm(d1, axis=1)
    at_s = np.linspace(0.0, timed.curve.duration_s, 4000)
    where = _way(timed.curve.t_s, s, speed, at_s)
    exact = np.array([point_on_blends(path, reach, w) for w in where])
    off = np.abs(timed.curve.sample(at_s)[0] - exact).max(axis=0)
    assert np.all(off <= timed.astray_rad + 1e-9)
    assert np.any(off > 0.3 * timed.astray_rad), "the bound is close"
    assert timed.astray_rad.max() < 3e-4


def test_lines_that_are_not_known_to_be_free_are_looked_at(bench):
    rng = np.random.default_rng(3)
    told = 0
    for _ in range(40):
        path = _path(rng, 4)
        cells = _cells(bench, rng, path)
        free = [bench.checker.segment(cells, a, b) for a, b in itertools.pairwise(path)]
        reach, blocked = bench.checker.fit_blends(cells, path, np.array(free, dtype=np.uint8), 1.0)
        if all(free):
            assert blocked == -1
        if blocked >= 0:
            told += 1
            assert not free[blocked]
        elif not all(free):  # what is not free was rounded away
            k = free.index(False)
            assert reach[k] > 0 or reach[k + 1] > 0
    assert told > 3


def test_reaches_equal_the_slow_twins(bench):
    rng = np.random.default_rng(5)
    equal = rounded = halved = 0
    for _ in range(25):
        path = _path(rng)
        cells = _cells(bench, rng, path)
        reach, _ = bench.checker.fit_blends(cells, path, np.ones(len(path) - 1, dtype=np.uint8), 1.0)
        expected = reach_of_corners(path, 1.0, lambda q: bench.checker.pose(cells, q)[0] == FREE)  # noqa: B023
        equal += int(np.sum(np.isclose(reach, expected)))
        rounded += int(np.sum(reach > 0))
        full = reach_of_corners(path, 1.0, lambda q: True)
        halved += int(np.sum((reach > 0) & (reach < full * 0.99)))
    assert equal >= 0.97 * 25 * 6, "the twin looks at other places of a parabola, so a touch may be seen by one of them alone"
    assert rounded > 30 and halved > 5


@pytest.mark.parametrize("seed", range(8))
def test_samples_lie_on_the_rounded_path_and_derivatives_are_its(seed):
    rng = np.random.default_rng(seed)
    path = _path(rng)
    lengths = np.linalg.norm(np.diff(path, axis=0), axis=1)
    reach = np.zeros(len(path))
    reach[1:-1] = np.minimum(lengths[:-1], lengths[1:]) * rng.uniform(0.1, 0.5, size=4)
    n = sample_count(path, reach)
    s, (q, d1, d2, d2_before) = np.empty(n), np.empty((4, n, 6))
    sample_blends(path, reach, s, q, d1, d2, d2_before)
    assert np.all(np.diff(s) > 0) and s[0] == 0 and np.allclose(q[[0, -1]], path[[0, -1]])
    h = 1e-6
    for i in range(1, n - 1):
        np.testing.assert_allclose(q[i], point_on_blends(path, reach, s[i]), atol=1e-9)
        ahead, behind = point_on_blends(path, reach, s[i] + h), point_on_blends(path, reach, s[i] - h)
        np.testing.assert_allclose(d1[i], (ahead - behind) / (2 * h), atol=1e-4)
    for turned in (np.diff(s) @ d2[:-1], np.diff(s) @ d2_before[1:]):  # the direction turns by what second derivatives add up to
        np.testing.assert_allclose(turned, d1[-1] - d1[0], atol=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_a_rounded_motion_keeps_limits_ends_at_rest_and_beats_stopping(seed):
    rng = np.random.default_rng(seed)
    path = _path(rng)
    lengths = np.linalg.norm(np.diff(path, axis=0), axis=1)
    reach = np.zeros(len(path))
    reach[1:-1] = np.minimum(lengths[:-1], lengths[1:]) * 0.4
    timed = _timed(path, reach)
    assert limit_ratio(timed, LIMITS) <= 1.0 + 1e-6
    assert not timed.dq_rad_s[-1].any() and np.allclose(timed.q_rad[-1], path[-1])
    stopping = time_polyline(path, LIMITS)
    assert stopping is not None and timed.duration_s < stopping[0].duration_s


def test_a_corner_that_is_not_rounded_is_stopped_at():
    path = _path(np.random.default_rng(1))
    reach = np.array([0.0, 0.1, 0.0, 0.1, 0.1, 0.0])
    timed = _timed(path, reach)
    at = int(np.argmin(np.linalg.norm(timed.q_rad - path[2], axis=1)))
    assert np.allclose(timed.q_rad[at], path[2]) and not timed.dq_rad_s[at].any()
    assert np.all(np.diff(timed.t_s) > 0) and limit_ratio(timed, LIMITS) <= 1.0 + 1e-6


def test_a_start_in_motion_is_kept_or_refused():
    path = _path(np.random.default_rng(2))
    unit = (path[1] - path[0]) / np.linalg.norm(path[1] - path[0])
    reach = np.array([0.0, 0.05, 0.05, 0.05, 0.05, 0.0])
    timed = _timed(path, reach, 0.2 * unit)
    assert np.allclose(timed.dq_rad_s[0], 0.2 * unit)
    assert time_blends(path, reach, LIMITS, 20.0 * unit) is None


@pytest.mark.parametrize("at", [[0.0, 1.0, 2.0], [0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [0.0, 1.0, 1.0, 1.0, 2.0], [0.0]])
def test_pieces_without_length_are_left_out_with_what_is_known_of_them(at):
    q = np.outer(at, np.ones(6))
    n = len(q) - 1
    pieces = Pieces(q, np.arange(n, dtype=np.uint8), np.arange(n)).without_repeats(1e-6)
    np.testing.assert_array_equal(pieces.q_rad[:, 0], sorted(set(at)))
    lasts = [k for k in range(n) if at[k + 1] > at[k]]
    assert pieces.origin.tolist() == pieces.proven.tolist() == lasts


@pytest.mark.parametrize("n_checks", [0, 3, 10, 40])
def test_cut_corners_equals_its_slow_twin(bench, n_checks):
    rng = np.random.default_rng(7)
    shortened = 0
    for _ in range(12):
        path = _path(rng, 10)
        cells = _cells(bench, rng, path)
        c, kept, proven = bench.checker, np.empty(len(path), dtype=np.int64), np.empty(len(path), dtype=np.uint8)
        n = cut_corners(c.arm, c.solids, cells, c.safety_m, c.step_m, path, 0, n_checks, kept, proven)

        def is_free(a: int, b: int) -> bool:
            return bench.checker.segment(cells, path[a], path[b])  # noqa: B023

        assert kept[:n].tolist() == kept_corners(len(path), 0, n_checks, is_free)
        shortened += n < len(path)
        skips = np.diff(kept[:n]) > 1
        assert np.array_equal(proven[: n - 1] == 1, skips)
        assert all(is_free(a, b) for (a, b), looked in zip(itertools.pairwise(kept[:n]), skips, strict=True) if looked)
    assert shortened > 0 or n_checks == 0


def test_a_slow_arm_does_not_stop_at_the_end_of_its_short_lead_in(bench):
    """A splice at 0.1 rad/s leads in for a milliradian: that corner is rounded too."""
    velocity = np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])
    start = bench.robot.home_rad
    path = np.stack([start, start + 1.1 * velocity * 0.1 / (2 * 5.0), start + np.array([0.05, 0.1, -0.3, 0.0, 0.2, 0.3])])
    reach, _ = bench.checker.fit_blends(cells_of(bench.grid, np.empty(0, dtype=np.int32)), path, np.ones(2, dtype=np.uint8), 1.0)
    timed = _timed(path, reach, velocity)
    assert reach[1] > 0.0
    speed = np.linalg.norm(timed.dq_rad_s[:-1], axis=1)
    assert speed.min() > 0.03
