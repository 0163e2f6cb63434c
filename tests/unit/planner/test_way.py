"""Ways looked at from the coarse to the fine: as every pose of the finest step by itself."""

from __future__ import annotations

import numpy as np
import pytest

from services.planner.core.world import cells_of
from services.planner.kernels.collision import FREE, HIT_CELL
from services.planner.kernels.moves import parabola_moves, segment_moves
from services.planner.kernels.way import line_between_is_free, line_is_free, new_rooms, parabola_is_free, pose_room
from tests.support.exact import cube_distance_m

STEP_M = 0.02


def _case(bench, rng):
    """A way from a free pose, and a few cells beside it."""
    a = bench.free_rad[rng.integers(len(bench.free_rad))]
    legs = rng.normal(scale=0.2, size=(2, 6))
    near = bench.robot.tool_pose(a + legs[0])[:3, 3] + rng.normal(scale=0.2, size=(4, 3))
    flat = np.unique(bench.grid.cells_of(near))
    return a, legs, cells_of(bench.grid, flat[flat >= 0].astype(np.int32))


def _agree(bench, cells, poses, is_free: bool) -> bool:
    """Whether the verdict on a way is that on its poses; what only rounding of the distance grids sees may be left out."""
    hits = [(q, bench.checker.pose(cells, q)) for q in poses]
    hits = [(q, verdict, index) for q, (verdict, index) in hits if verdict != FREE]
    if not is_free:
        assert hits, "a way is blocked only where one of its poses is"
        return True
    for q, verdict, index in hits:
        assert verdict == HIT_CELL
        assert cube_distance_m(bench.robot, q, cells.centre_m[index], cells.half_m) > bench.checker.safety_m, "what is too near was seen"
    return not hits


@pytest.mark.parametrize("seed", range(3))
def test_a_line_is_free_as_its_poses_are(bench, seed):
    rng, c = np.random.default_rng(seed), bench.checker
    R, T = np.empty((2, 7, 3, 3)), np.empty((2, 7, 3))
    free = same = 0
    for _ in range(40):
        a, legs, cells = _case(bench, rng)
        leg = legs.sum(axis=0)
        n = segment_moves(c.arm, a, leg, STEP_M, np.empty(len(c.arm.moving)), R, T)
        is_free = line_is_free(c.arm, c.solids, cells, c.safety_m, STEP_M, a, a + leg)
        same += _agree(bench, cells, a + np.linspace(0, 1, n + 1)[:, None] * leg, is_free)
        free += is_free
    assert 3 < free < 37
    assert same >= 39


def test_what_is_known_of_its_ends_changes_no_verdict(bench):
    """Whichever of its ends was looked at before, and whether its middle is looked at first."""
    rng, c = np.random.default_rng(7), bench.checker
    free = same = 0
    for k in range(40):
        a, legs, cells = _case(bench, rng)
        b = a + legs.sum(axis=0)
        check = (c.arm, c.solids, cells, c.safety_m)
        rooms = new_rooms(c.arm, 2)
        ends_free = [pose_room(*check, q, room) for q, room in zip((a, b), rooms, strict=True)]
        assert ends_free == [c.pose(cells, q)[0] == FREE for q in (a, b)]
        assert np.isnan(rooms[:, 0]).tolist() == [not is_free for is_free in ends_free]
        for end in range(2):
            if k >> end & 1:
                rooms[end, 0] = np.nan
        is_free = line_between_is_free(*check, STEP_M, a, b, *rooms)
        same += is_free == line_is_free(*check, STEP_M, a, b)
        free += is_free
        assert not is_free or (rooms > 0.0).all(), "both ends were looked at, and have room"
    assert 3 < free < 37
    assert same >= 39


@pytest.mark.parametrize("seed", range(3))
def test_a_parabola_is_free_as_its_poses_are(bench, seed):
    rng, c = np.random.default_rng(100 + seed), bench.checker
    R, T = np.empty((2, 7, 3, 3)), np.empty((2, 7, 3))
    free = same = 0
    for _ in range(40):
        a, (leg_in, leg_out), cells = _case(bench, rng)
        n = parabola_moves(c.arm, a, leg_in, leg_out, STEP_M, np.empty(len(c.arm.moving)), R, T)
        u = np.linspace(0, 1, n + 1)[:, None]
        is_free = parabola_is_free(c.arm, c.solids, cells, c.safety_m, STEP_M, a, leg_in, leg_out)
        same += _agree(bench, cells, a + 2 * u * (1 - u) * leg_in + u**2 * (leg_in + leg_out), is_free)
        free += is_free
    assert 3 < free < 37
    assert same >= 39


def test_no_body_outruns_what_it_is_said_to_move(bench):
    rng, c = np.random.default_rng(5), bench.checker
    R, T = np.empty((2, 7, 3, 3)), np.empty((2, 7, 3))
    for k in range(40):
        a, body_m = bench.free_rad[rng.integers(len(bench.free_rad))], np.empty(len(c.arm.moving))
        leg, other = rng.normal(scale=0.3, size=(2, 6))
        if k % 2:
            n = segment_moves(c.arm, a, leg, STEP_M, body_m, R, T)
            poses = a + np.linspace(0, 1, n + 1)[:, None] * leg
        else:
            n = parabola_moves(c.arm, a, leg, other, STEP_M, body_m, R, T)
            u = np.linspace(0, 1, n + 1)[:, None]
            poses = a + 2 * u * (1 - u) * leg + u**2 * (leg + other)
        frames = bench.robot.joint_poses(poses)
        for b, body in enumerate(bench.robot.bodies):
            places = np.einsum("krc,vc->kvr", frames[:, body.joint, :3, :3], body.vertices[::10]) + frames[:, body.joint, None, :3, 3]
            moved = np.linalg.norm(np.diff(places, axis=0), axis=2).max()
            assert not c.arm.moving[b] or moved <= body_m[b] + 1e-9
        assert body_m.max() <= STEP_M + 1e-12
