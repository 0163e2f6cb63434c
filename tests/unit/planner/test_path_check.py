from __future__ import annotations

import numpy as np

from common.robot.trajectory import JointTrajectory
from services.planner.core.world import cells_of, no_cells
from services.planner.kernels.collision import FREE, HIT_CELL
from services.planner.kernels.moves import segment_steps
from services.planner.kernels.path import _hermite


def _curve(q, seed=0):
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.05, 0.2, size=len(q)))
    return JointTrajectory(t - t[0], q, rng.normal(scale=0.5, size=q.shape))


def test_the_checked_interpolant_is_the_driven_one():
    rng = np.random.default_rng(0)
    curve = _curve(rng.normal(size=(6, 6)))
    out = np.empty(6)
    for k in range(5):
        for u in (0.0, 0.3, 0.71, 1.0):
            at = curve.t_s[k] + u * (curve.t_s[k + 1] - curve.t_s[k])
            _hermite(curve.t_s, curve.q_rad, curve.dq_rad_s, k, at, out)
            np.testing.assert_allclose(out, curve.sample(at)[0], atol=1e-12)


def test_no_part_of_the_arm_outruns_the_steps(bench):
    """Every vertex of every mesh moves at most the step between two samples of a segment."""
    rng = np.random.default_rng(1)
    R, T = np.empty((2, 7, 3, 3)), np.empty((2, 7, 3))
    for _ in range(10):
        a = bench.free_rad[rng.integers(len(bench.free_rad))]
        b = a + rng.normal(scale=0.3, size=6)
        n = segment_steps(bench.checker.arm, a, b - a, 0.01, R, T)
        q = a + (b - a) * np.linspace(0, 1, n + 1)[:, None]
        frames = bench.robot.joint_poses(q)
        for body in bench.robot.bodies:
            points = np.einsum("krc,vc->kvr", frames[:, body.joint, :3, :3], body.vertices[::50]) + frames[:, None, body.joint, :3, 3]
            assert np.linalg.norm(np.diff(points, axis=0), axis=2).max() <= 0.01


def test_a_curve_is_blocked_where_a_dense_walk_says_so(bench):
    rng = np.random.default_rng(2)
    agreed = 0
    for trial in range(30):
        q = bench.free_rad[rng.integers(len(bench.free_rad))] + np.cumsum(rng.normal(scale=0.15, size=(5, 6)), axis=0)
        curve = _curve(q, trial)
        place = bench.robot.tool_pose(curve.sample(curve.duration_s * rng.random())[0])[:3, 3] + rng.normal(scale=0.06, size=3)
        flat = bench.grid.cells_of(place[None])
        if flat[0] < 0:
            continue
        cells = cells_of(bench.grid, flat)
        met = bench.checker.curve_meets(cells, curve)
        times = np.linspace(0, curve.duration_s, 2000)
        hits = [t for t, pose in zip(times, curve.sample(times)[0], strict=True) if bench.checker.cells_hit(cells, pose).any()]
        if not hits:
            assert met is None
        elif len(hits) > 20:  # a graze shorter than a step may fall between two checked poses
            assert met is not None and abs(met - hits[0]) < 0.1
            agreed += 1
    assert agreed >= 5


def test_a_window_of_a_curve(bench):
    home = bench.robot.home_rad
    q = home + np.array([0.0, 0.4, 0.8])[:, None] * np.eye(6)[0]
    curve = JointTrajectory(np.array([0.0, 1.0, 2.0]), q, np.zeros_like(q))
    cell = cells_of(bench.grid, bench.grid.cells_of(bench.robot.tool_pose(q[1])[None, :3, 3]))
    first = bench.checker.curve_meets(cell, curve)
    assert first is not None and 0.3 < first < 1.0
    assert bench.checker.curve_meets(cell, curve, to_s=first - 0.2) is None
    assert bench.checker.curve_meets(cell, curve, from_s=1.9) is None
    assert bench.checker.curve(cell, curve)[0] == HIT_CELL
    assert bench.checker.curve(no_cells(bench.grid), curve)[0] == FREE
    assert bench.checker.curve_meets(no_cells(bench.grid), curve) is None
