"""How near the arm is, by the physics engine and coal; how fast it may therefore be, by the law as it is written."""

from __future__ import annotations

import coal
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.robot.pairs import coal_mesh
from services.planner.core.lookup import BlockedCounts, LookupTable
from services.planner.core.separation import Separation
from services.planner.core.timing import Limits, limit_ratio, time_blends, time_polyline
from services.planner.core.world import World, cells_of
from services.planner.kernels.cells import BLOCK, GROUP
from services.planner.kernels.reach import look_far, reach_grid, reach_of
from services.planner.kernels.separation import SpeedLaw, allowed_speed, body_separation, needed_separation
from services.planner.offline.regions import box_cells, random_box
from services.robot_sim.adapters import bullet
from services.robot_sim.core.obstacles import Thing, pose_of
from tests.support.cell import ur3, ur3_cell
from tests.support.slow_layers import slow_far
from tests.support.slow_separation import slow_allowed_speed, slow_body_separation, slow_clearance

STANDING = SpeedLaw(person_m_s=0.0, reaction_s=0.0, braking_m_s2=2.5, reduced_m_s=0.25)
MOVING = STANDING._replace(person_m_s=0.25, reaction_s=0.15)
LIMITS = Limits(0.8 * ur3().max_velocity_rad_s, 0.9 * ur3().max_acceleration_rad_s2)
TWO_CELLS_M = 0.04  # issue


@pytest.fixture(scope="module")
def separation(bench):
    return Separation(bench.checker.arm, reach_of(bench.checker.arm.grids, 0.15), STANDING, MOVING)


def _transform(T):
    return coal.Transform3s(np.ascontiguousarray(T[:3, :3]), np.ascontiguousarray(T[:3, 3]))


def _true_gaps(bench, q, cells, meshes):
    """(meshes,) exact distance of each bare mesh (with its joint) to the nearest of the cells' cubes."""
    cube = coal.Box(*[2 * cells.half_m] * 3)
    frames = [_transform(T) for T in bench.robot.joint_poses(q[None])[0]]
    places = [coal.Transform3s(np.eye(3), c) for c in cells.centre_m]
    ask = (coal.DistanceRequest(), coal.DistanceResult)
    return np.array([min(coal.distance(mesh, frames[j], cube, at, ask[0], ask[1]()) for at in places) for mesh, j in meshes])


# --- distances ---


def test_far_grids_equal_their_twin_and_are_never_above_the_truth(bench, separation):
    reach, rng = separation.reach, np.random.default_rng(0)
    ball = coal.Sphere(1e-6)
    for b, body in enumerate(bench.robot.bodies):
        mesh = coal_mesh(body)
        low, high = body.vertices.min(axis=0) - 0.18, body.vertices.max(axis=0) + 0.18
        below = []
        for point in rng.uniform(low, high, size=(60, 3)):
            told = look_far(reach.distance, reach_grid(reach, b), *point)
            assert told == slow_far(reach, b, point)
            at = coal.Transform3s(np.eye(3), point)
            true = coal.distance(mesh, coal.Transform3s(), ball, at, coal.DistanceRequest(), coal.DistanceResult())
            assert told <= max(true, 0.0) + 2e-5
            if np.any((point < body.vertices.min(axis=0)) | (point > body.vertices.max(axis=0))):  # coal knows no inside
                below.append(min(true, reach.far_m) - told)
        assert max(below) < 0.0173 + 0.0087 + 0.0025  # a voxel's diagonal, and the fine grid's or the covers' rounding


def test_clearance_equals_the_slow_twin(bench):
    rng = np.random.default_rng(1)
    for q in bench.free_rad[:5]:
        flat = np.unique(rng.integers(bench.grid.n_cells, size=100)).astype(np.int32)
        cells = cells_of(bench.grid, flat)
        expected = slow_clearance(bench.checker.arm, bench.checker.solids, cells, bench.robot.joint_poses(q[None])[0])
        assert bench.checker.clearance(cells, q) == pytest.approx(expected, abs=1e-9)


def test_more_cells_never_raise_it(bench):
    rng = np.random.default_rng(2)
    for q in bench.free_rad[:5]:
        flat = rng.permutation(bench.grid.n_cells)[:300].astype(np.int32)
        told = [bench.checker.clearance(cells_of(bench.grid, np.sort(flat[:n])), q) for n in (0, 1, 10, 100, 300)]
        assert told == sorted(told, reverse=True)


def test_against_the_physics_engine_never_above_and_at_most_two_cells_below(bench):
    rng = np.random.default_rng(3)
    below = []
    with bullet.World(ur3(), ur3_cell().static, 0.004) as world:
        for k, q in enumerate(bench.free_rad[:60]):
            world.reset(q)
            frames = bench.robot.joint_poses(q[None])[0]
            flat = []
            for i in range(2):
                low, high = random_box(frames[rng.integers(2, 7), :3, 3] + rng.normal(scale=0.2, size=3), 0.03, 0.25, rng)
                low[2] = max(low[2], 0.0)
                if high[2] <= low[2] + 0.01:
                    continue
                world.add(Thing(f"{k}-{i}", "box", tuple(high - low), pose_of(((low + high) / 2).tolist(), None, "test"), np.zeros(3)))
                flat.append(box_cells(bench.grid, low, high))
            found = [near.distance_m for near in (world.nearest_obstacle(3.0), world.nearest_static(3.0)) if near is not None]
            for i in range(2):
                if f"{k}-{i}" in world._obstacles:
                    world.remove(f"{k}-{i}")
            cells = cells_of(bench.grid, np.unique(np.concatenate(flat)) if flat else np.empty(0, dtype=np.int32))
            if min(found) > 0.0:
                below.append(min(found) - bench.checker.clearance(cells, q))
    below = np.array(below)
    assert len(below) > 30
    assert below.min() >= 0.0, "told farther than it is"
    assert below.max() <= TWO_CELLS_M


@pytest.mark.parametrize("n_cells", [1, BLOCK + 1, 3 * BLOCK * GROUP + 5])
def test_a_body_is_as_near_as_cell_by_cell(bench, separation, n_cells):
    """Also where the cells fill several groups of blocks, of which most are passed over."""
    rng, arm, answers, exact = np.random.default_rng(n_cells), bench.checker.arm, set(), 0
    for q in bench.free_rad[:6]:
        frames = bench.robot.joint_poses(q[None])[0]
        middle = frames[rng.integers(2, 7), :3, 3] + rng.normal(scale=0.3, size=3)
        away_m = np.linalg.norm(bench.grid.centres(np.arange(bench.grid.n_cells)) - middle, axis=1)
        near, anywhere = np.argsort(away_m)[: n_cells // 2 + 1], rng.permutation(bench.grid.n_cells)
        cells = cells_of(bench.grid, np.unique(np.concatenate([near, anywhere[: n_cells // 2]])).astype(np.int32))
        for b in np.flatnonzero(arm.moving):
            frame = frames[arm.grids.body_joint[b]]
            turn, shift = np.ascontiguousarray(frame[:3, :3]), np.ascontiguousarray(frame[:3, 3])
            for enough_m in (0.05, 0.4, 2.0):
                told = body_separation(arm, separation.reach, cells, b, turn, shift, enough_m)
                least, most = slow_body_separation(arm, separation.reach, cells, b, frame, enough_m)
                assert least - 1e-9 <= told <= most + 1e-9
                exact += most - least < 1e-9
                answers.add(round(told, 6))
    assert len(answers) > 20 and exact > 50, "or this shows nothing"


# --- the law ---


@pytest.mark.parametrize(
    ("separation_m", "standing", "moving"),
    [(0.01, 0.25, 0.25), (0.02, 0.3162, 0.25), (0.05, 0.5, 0.25), (0.12, 0.7746, 0.2712), (0.3, 1.2247, 0.6800), (1.0, 2.2361, 1.6560)],
)
def test_the_law_in_figures(separation_m, standing, moving):
    assert allowed_speed(STANDING, separation_m) == pytest.approx(standing, abs=1e-4)
    assert allowed_speed(MOVING, separation_m) == pytest.approx(moving, abs=1e-4)


@given(st.floats(0.0, 2.0), st.sampled_from([STANDING, MOVING]))
def test_the_law_is_the_standards(separation_m, law):
    speed = allowed_speed(law, separation_m)
    assert speed == pytest.approx(slow_allowed_speed(law, separation_m), abs=1e-9)
    assert speed == law.reduced_m_s or needed_separation(law, speed) == pytest.approx(separation_m, abs=1e-9)


# --- motions ---


def _world(bench, flat, recent=()):
    n = bench.grid.n_cells + 1
    rows = (np.zeros((1, n), dtype=np.int64), np.empty(0, dtype=np.uint16))
    counts = BlockedCounts(LookupTable(*rows, *rows, np.empty(0, dtype=np.int32)), 1, 1)
    counts.set_cells(np.asarray(flat, dtype=np.int32))
    return World.of(bench.grid, counts, np.asarray(recent, dtype=np.int32))


def _path(seed):
    """Three pieces with rounded corners, the tool passing through the air in front of the arm."""
    rng = np.random.default_rng(seed)
    steps = rng.uniform(0.2, 0.7, size=(3, 1)) * np.array([[1.0, 0.1, -0.2, 0.1, 0.0, 0.3]]) + rng.normal(scale=0.1, size=(3, 6))
    path = np.vstack([[-0.8, -1.3, 1.3, -1.6, -1.57, 0.0], steps]).cumsum(axis=0)
    return path, np.array([0.0, 0.1, 0.1, 0.0])


def _timed(path, reach, velocity_start=None, caps=None):
    timed = time_blends(path, reach, LIMITS, velocity_start, caps)
    assert timed is not None
    return timed.curve


def _beside(bench, q, rng, n):
    """Cells of a 6 cm box some 5 to 20 cm from the tool."""
    middle = bench.robot.tool_pose(q)[:3, 3] + rng.normal(size=3) * 0.12
    return box_cells(bench.grid, middle - 0.03, middle + 0.03)[:n]


def _speeds(bench, q, dq):
    """(bodies,) speed of the fastest vertex of each moving body, by finite differences."""
    step_s = 1e-6
    before, after = bench.robot.joint_poses(np.stack([q, q + dq * step_s]))
    moving = [body for body in bench.robot.bodies if not body.immobile]
    points = [[b.vertices @ T[b.joint][:3, :3].T + T[b.joint][:3, 3] for b in moving] for T in (before, after)]
    return np.array([np.linalg.norm(y - x, axis=1).max() / step_s for x, y in zip(*points, strict=True)])


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("law", ["standing", "moving"])
def test_no_part_of_the_arm_is_faster_than_its_separation_allows(bench, separation, seed, law):
    path, reach = _path(seed)
    rng = np.random.default_rng(seed)
    flat = _beside(bench, path[1], rng, 27)
    world = _world(bench, flat, flat if law == "moving" else ())
    free, slow = _timed(path, reach), _timed(path, reach, None, separation.caps(world))
    assert slow.duration_s >= free.duration_s and limit_ratio(slow, LIMITS) <= 1.0 + 1e-5
    bodies = [(coal_mesh(body), body.joint) for body in bench.robot.bodies if not body.immobile]
    cells, too_fast = cells_of(bench.grid, flat), 0
    for share in np.linspace(0.02, 0.98, 40):
        for motion, is_free in ((slow, False), (free, True)):
            q, dq, _ = motion.sample(share * motion.duration_s)
            gaps = _true_gaps(bench, q, cells, bodies)
            allowed = np.array([slow_allowed_speed(getattr(separation, law), gap) for gap in gaps])
            ratio = (_speeds(bench, q, dq) / allowed).max()
            too_fast += is_free and ratio > 1.0
            assert is_free or ratio <= 1.03, "the cubic between two knots may lead their mean by a little"
    assert slow.duration_s > free.duration_s or too_fast == 0


def test_it_slows_and_is_the_same_twice(bench, separation):
    path, reach = _path(0)
    flat = _beside(bench, path[1], np.random.default_rng(0), 27)
    caps = separation.caps(_world(bench, flat))
    one, two = (_timed(path, reach, None, caps) for _ in range(2))
    assert one.t_s.tobytes() == two.t_s.tobytes() and one.dq_rad_s.tobytes() == two.dq_rad_s.tobytes()
    assert one.duration_s > 1.05 * _timed(path, reach).duration_s
    corners = path[:2]
    assert time_polyline(corners, LIMITS, None, caps)[0].duration_s > 1.05 * time_polyline(corners, LIMITS)[0].duration_s


def test_without_cells_it_is_as_fast_as_ever(bench, separation):
    path, reach = _path(1)
    far = bench.grid.cells_of(np.array([[-0.75, -0.75, 0.9]]))
    for world in (_world(bench, []), _world(bench, far)):
        slow, free = _timed(path, reach, None, separation.caps(world)), _timed(path, reach)
        assert slow.t_s.tobytes() == free.t_s.tobytes()


def test_a_start_too_fast_for_what_is_near_brakes_and_goes_on(bench, separation):
    path, reach = _path(2)
    reach[1] = 0.0  # a stop at the first corner
    first = path[1] - path[0]
    velocity = first / np.abs(first / LIMITS.velocity).max() * 0.8
    flat = _beside(bench, path[0], np.random.default_rng(1), 27)
    caps = separation.caps(_world(bench, flat, flat))
    slow = _timed(path, reach, velocity, caps)
    assert slow.dq_rad_s[0] == pytest.approx(velocity)
    assert limit_ratio(slow, LIMITS) <= 1.0 + 1e-5
    assert slow.duration_s > _timed(path, reach, velocity).duration_s
    assert np.abs(slow.sample(0.15)[1]).max() < np.abs(velocity).max(), "it brakes at once"
