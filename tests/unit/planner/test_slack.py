"""What is not looked at along a way: never anything that could have been hit."""

from __future__ import annotations

import numpy as np

from services.planner.core.arm import body_levers, solids_of
from services.planner.core.world import cells_of
from services.planner.kernels.collision import FREE, HIT_CELL, frames_verdict, no_slack, pose_verdict, way_verdict
from services.planner.kernels.moves import segment_steps
from services.planner.kernels.static_layer import _field_at, body_static_gap, solid_distance
from tests.support.cell import ur3_cell
from tests.support.exact import cube_distance_m

STEP_M = 0.02


def test_no_point_moves_farther_than_its_lever(bench):
    rng = np.random.default_rng(0)
    lever = body_levers(bench.robot)
    assert np.all(lever[:, 0] < 1.3), "bounds that are far from the arm's reach save nothing"
    for _ in range(40):
        q = rng.uniform(bench.robot.position_min_rad, bench.robot.position_max_rad)
        for j in range(6):
            turned = q.copy()
            turned[j] += 1e-4
            frames = bench.robot.joint_poses(np.stack([q, turned]))
            for b, body in enumerate(bench.robot.bodies):
                points = body.vertices[::20]
                T = frames[:, body.joint]
                places = np.einsum("krc,vc->kvr", T[:, :3, :3], points) + T[:, None, :3, 3]
                assert np.linalg.norm(places[1] - places[0], axis=1).max() <= lever[b, j] * 1e-4 * (1 + 1e-6)


def test_the_field_is_a_lower_bound_near_and_far():
    solids = solids_of(ur3_cell().static)
    rng = np.random.default_rng(1)
    for x, y, z in rng.uniform([-1.2, -1.2, -0.3], [1.2, 1.2, 1.2], size=(3000, 3)):
        true = min(
            solid_distance(solids.kind, solids.size_m, solids.rotation, solids.translation, s, x, y, z) for s in range(len(solids.kind))
        )
        assert _field_at(solids.field, x, y, z) <= true + 1e-9


def test_the_gap_to_the_static_layer_is_a_lower_bound(bench):
    """Against exact distances of every sphere that covers a body; these stick out of it by 8 mm at most."""
    arm, solids, grids = bench.checker.arm, bench.checker.solids, bench.robot.grids
    for q in bench.free_rad[:40]:
        T = bench.robot.joint_poses(q[None])[0]
        for b in np.flatnonzero(arm.moving):
            frame = T[grids.body_joint[b]]
            gap, solid = body_static_gap(grids, solids, b, np.ascontiguousarray(frame[:3, :3]), frame[:3, 3].copy(), 0.01)
            first, last = (grids.group_sphere_offset[grids.group_offset[b + k]] for k in (0, 1))
            true = min(
                solid_distance(
                    solids.kind, solids.size_m, solids.rotation, solids.translation, s, *(frame[:3, :3] @ sphere[:3] + frame[:3, 3])
                )
                - sphere[3]
                for sphere in grids.spheres_m[first:last]
                for s in range(len(solids.kind))
            )
            assert (solid >= 0) == (gap <= 0.0) == (true - 0.01 <= 0.0)
            assert gap <= 0.0 or gap <= true - 0.01 + 0.008


def test_a_way_is_blocked_only_where_a_pose_is_and_free_only_where_nothing_is_too_near(bench):
    rng = np.random.default_rng(2)
    arm, solids = bench.checker.arm, bench.checker.solids
    R, T = np.empty((2, 7, 3, 3)), np.empty((2, 7, 3))
    looked = could_look = 0
    for _ in range(60):
        a = bench.free_rad[rng.integers(len(bench.free_rad))]
        dq = rng.normal(scale=0.25, size=6)
        near = bench.robot.tool_pose(a + rng.random() * dq)[:3, 3] + rng.normal(scale=0.12, size=(12, 3))
        flat = np.unique(bench.grid.cells_of(near))
        cells = cells_of(bench.grid, flat[flat >= 0])
        n = segment_steps(arm, a, dq, STEP_M, R, T)
        slack, turned = no_slack(arm), np.abs(dq) / n
        for s in range(n + 1):
            q = a + dq * (s / n)
            before = slack.cell_m.copy()
            verdict, _ = way_verdict(arm, solids, cells, 0.02, q, turned, STEP_M, slack, R[0], T[0])
            plain, index = pose_verdict(arm, solids, cells, 0.02, q, R[1], T[1])
            looked, could_look = looked + int(np.sum(slack.cell_m > before)), could_look + int(arm.moving.sum())
            if verdict != FREE:
                assert plain != FREE
                break
            if plain == HIT_CELL:
                true = cube_distance_m(bench.robot, q, cells.centre_m[index], cells.half_m)
                assert true > 0.02
            else:
                assert plain == FREE
    assert looked < 0.7 * could_look, "slack saves looks"


def test_fresh_slack_looks_at_everything(bench):
    arm, solids = bench.checker.arm, bench.checker.solids
    q = bench.free_rad[0]
    tool = bench.grid.cells_of(bench.robot.tool_pose(q)[None, :3, 3])
    frames = bench.robot.joint_poses(q[None])[0]
    R, T = np.ascontiguousarray(frames[:, :3, :3]), np.ascontiguousarray(frames[:, :3, 3])
    slack = no_slack(arm)
    assert frames_verdict(arm, solids, cells_of(bench.grid, tool[:0]), 0.02, q, R, T, slack)[0] == FREE
    assert np.all(slack.cell_m[arm.moving > 0] > 0) and np.all(slack.static_m[arm.moving > 0] > 0) and np.all(slack.pair_m > 0)
    assert frames_verdict(arm, solids, cells_of(bench.grid, tool), 0.02, q, R, T, no_slack(arm))[0] == HIT_CELL
