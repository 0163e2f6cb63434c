from __future__ import annotations

from dataclasses import replace

import coal
import numpy as np
import pytest

from common.cell import SolidConfig
from common.robot.pairs import coal_mesh
from services.planner.core.arm import arm_of, solids_of
from services.planner.core.world import cells_of, no_cells
from services.planner.kernels.collision import FREE, HIT_CELL, HIT_SELF, HIT_STATIC, pose_verdict
from tests.support.slow_planner import slow_pose_cells


def _transform(T):
    return coal.Transform3s(np.ascontiguousarray(T[:3, :3]), np.ascontiguousarray(T[:3, 3]))


def _near_cells(bench, q, rng, n=300):
    """Cells around the arm's surface: where the decision is close."""
    frames = bench.robot.joint_poses(q[None])[0]
    points = []
    for body in bench.robot.bodies:
        if not body.immobile:
            chosen = body.vertices[rng.integers(len(body.vertices), size=n // 7)]
            points.append(chosen @ frames[body.joint][:3, :3].T + frames[body.joint][:3, 3] + rng.normal(scale=0.03, size=chosen.shape))
    cells = bench.grid.cells_of(np.concatenate(points))
    return np.unique(cells[cells >= 0])


def test_cells_equal_the_slow_twin(bench):
    rng = np.random.default_rng(1)
    for q in bench.free_rad[:4]:
        flat = _near_cells(bench, q, rng)
        cells = cells_of(bench.grid, flat)
        frames = bench.robot.joint_poses(q[None])[0]
        expected = slow_pose_cells(bench.checker.arm, frames, cells.centre_m, cells.half_m, 0.02)
        assert np.array_equal(bench.checker.cells_hit(cells, q), expected)
        assert expected.any() and not expected.all()


@pytest.mark.parametrize("n_boxes", [1, 4, 30])
def test_a_pose_among_many_cells_is_blocked_exactly_if_one_of_them_blocks_it(bench, n_boxes):
    """Whatever is ruled out without a look at the single cell: groups of blocks, blocks, cells far from the body's box and parts."""
    rng = np.random.default_rng(n_boxes)
    verdicts, n_cells = [], []
    for _ in range(12):
        middles = rng.uniform([-0.6, -0.6, 0.0], [0.6, 0.6, 0.8], size=(n_boxes, 1, 3))
        points = middles + rng.uniform(-0.08, 0.08, size=(n_boxes, 400, 3))
        flat = np.unique(bench.grid.cells_of(points.reshape(-1, 3)))
        cells = cells_of(bench.grid, flat[flat >= 0])
        n_cells.append(len(cells.flat))
        for q in bench.free_rad[rng.integers(len(bench.free_rad), size=20)]:
            verdict, index = bench.checker.pose(cells, q)
            blocking = bench.checker.cells_hit(cells, q)
            assert (verdict == HIT_CELL) == blocking.any()
            assert verdict != HIT_CELL or blocking[index]
            verdicts.append(verdict)
    assert {FREE, HIT_CELL} <= set(verdicts)
    assert n_boxes < 30 or min(n_cells) > 4 * 256, "several groups of blocks"


@pytest.mark.parametrize("safety_m", [0.0, 0.005, 0.02])
def test_no_cell_that_is_truly_too_near_is_missed_and_few_others_block(bench, safety_m):
    """coal: exact distance between the cell's cube and the bare meshes."""
    rng = np.random.default_rng(2)
    meshes = [(coal_mesh(body), body.joint) for body in bench.robot.bodies if not body.immobile]
    half = bench.grid.resolution_m / 2
    cube = coal.Box(2 * half, 2 * half, 2 * half)
    slack = half / 4 * np.sqrt(3) + 0.0095  # an eighth of the cube's diagonal, and rounding of the distance grid
    surely_hit = surely_free = 0
    for q in bench.free_rad[:4]:
        cells = cells_of(bench.grid, _near_cells(bench, q, rng, 150))
        hit = bench.checker.cells_hit(cells, q, safety_m=safety_m)
        frames = [_transform(T) for T in bench.robot.joint_poses(q[None])[0]]
        for i, centre in enumerate(cells.centre_m):
            placed = coal.Transform3s(np.eye(3), centre)
            true = min(
                coal.distance(mesh, frames[joint], cube, placed, coal.DistanceRequest(), coal.DistanceResult()) for mesh, joint in meshes
            )
            if true <= safety_m:
                assert hit[i], (q, centre, true)
                surely_hit += 1
            elif true > safety_m + slack:
                inside = any(_inside(bench, body, q, centre) for body in bench.robot.bodies)
                assert inside or not hit[i], (q, centre, true)
                surely_free += 1
    assert surely_hit > 20 and surely_free > 20


@pytest.mark.parametrize("safety_m", [0.06, 0.12])
def test_room_beyond_the_distance_grids_is_measured_too(bench, safety_m):
    """A hand needs more room than the grids reach; what is nearer blocks, what is clearly farther does not."""
    rng = np.random.default_rng(4)
    meshes = [(coal_mesh(body), body.joint) for body in bench.robot.bodies if not body.immobile]
    half = bench.grid.resolution_m / 2
    cube = coal.Box(2 * half, 2 * half, 2 * half)
    slack = half * (np.sqrt(3) - 1) + half + 0.0085  # the cell's ball instead of its cube, and the spheres' overshoot
    blocked = free = 0
    for q in bench.free_rad[:10]:
        frames = [_transform(T) for T in bench.robot.joint_poses(q[None])[0]]
        for centre in bench.grid.centres(rng.choice(bench.grid.n_cells, 60).astype(np.int32)):
            placed = coal.Transform3s(np.eye(3), centre)
            true = min(
                coal.distance(mesh, frames[joint], cube, placed, coal.DistanceRequest(), coal.DistanceResult()) for mesh, joint in meshes
            )
            met = bench.checker.poses_meet(cells_of(bench.grid, bench.grid.cells_of(centre[None])), q[None], room_m=safety_m - 0.02)
            if true <= safety_m:
                assert met == 0, (q, centre, true)
                blocked += 1
            elif true > safety_m + slack:
                assert met is None, (q, centre, true)
                free += 1
    assert blocked > 5 and free > 50


def _inside(bench, body, q, centre):
    from common.robot.kernels import body_distance

    b = bench.robot.bodies.index(body)
    T = bench.robot.joint_poses(q[None])[0][body.joint]
    return body_distance(bench.robot.grids, b, *(T[:3, :3].T @ (centre - T[:3, 3]))) < 0.0


def test_static_and_self_agree_with_coal(bench):
    """What coal says touches is never called free; what is called blocked is within margin plus the spheres' overshoot."""
    from tests.support.cell import ur3_cell

    robot, cell = bench.robot, ur3_cell()
    meshes = [coal_mesh(body) for body in robot.bodies]
    drawn = np.random.default_rng(3).uniform(robot.position_min_rad, robot.position_max_rad, size=(300, 6))
    nothing = no_cells(bench.grid)
    verdicts = []
    for q in drawn:
        verdict, _ = bench.checker.pose(nothing, q)
        verdicts.append(verdict)
        frames = [_transform(T) for T in robot.joint_poses(q[None])[0]]
        static = min(
            coal.distance(meshes[b], frames[body.joint], coal.Box(*s.size_m), coal.Transform3s(np.eye(3), np.array(s.position_m)),
                          coal.DistanceRequest(), coal.DistanceResult())
            for b, body in enumerate(robot.bodies) if not body.immobile for s in cell.static
        )  # fmt: skip
        own = min(  # beyond what the pair keeps
            coal.distance(meshes[a], frames[robot.bodies[a].joint], meshes[b], frames[robot.bodies[b].joint],
                          coal.DistanceRequest(), coal.DistanceResult()) - margin
            for (a, b), margin in zip(robot.pairs, bench.checker.arm.pair_margin_m, strict=True)
        )  # fmt: skip
        if static <= 0.01 or own <= 0.0:
            assert verdict != FREE
        if verdict == HIT_STATIC:
            assert static <= 0.01 + 0.009
        if verdict == HIT_SELF:
            assert own <= 0.009 + 0.0095
    assert {FREE, HIT_STATIC, HIT_SELF} <= set(verdicts)


def test_a_pair_that_always_stands_near_keeps_less_but_something(bench):
    usual_m = np.full(len(bench.robot.pairs), 0.0101)
    usual_m[0] = 0.0099
    robot = replace(bench.robot, pair_usual_m=usual_m)
    assert arm_of(robot, static_margin_m=0.01, self_margin_m=0.005).pair_margin_m.tolist() == [0.002] + [0.005] * (len(usual_m) - 1)
    assert not arm_of(robot, static_margin_m=0.01, self_margin_m=0.0).pair_margin_m.any()


@pytest.mark.parametrize(
    ("solid", "blocked"),
    [
        (SolidConfig(name="post", shape="cylinder", size_m=[0.02, 0.5], position_m=(0.25, 0.0, 0.25)), True),
        (SolidConfig(name="post", shape="cylinder", size_m=[0.02, 0.5], position_m=(-0.5, 0.0, 0.25)), False),
        (SolidConfig(name="ball", shape="sphere", size_m=[0.05], position_m=(0.0, 0.0, 0.42)), True),
        (SolidConfig(name="ball", shape="sphere", size_m=[0.05], position_m=(0.5, 0.5, 0.5)), False),
        (SolidConfig(name="plank", shape="box", size_m=[1.0, 0.02, 0.02], position_m=(0.3, 0.11, 0.3), rpy_rad=(0.0, 0.0, 0.78)), True),
    ],
)
def test_each_kind_of_solid(bench, solid, blocked):
    arm = arm_of(bench.robot, static_margin_m=0.0, self_margin_m=0.0)
    R, T = np.empty((7, 3, 3)), np.empty((7, 3))
    verdict, _ = pose_verdict(arm, solids_of([solid]), no_cells(bench.grid), 0.02, bench.robot.home_rad, R, T)
    assert (verdict == HIT_STATIC) is blocked


def test_reasons_name_things(bench):
    straight_down = np.array([0.0, 0.6, 0.3, 0.0, 0.0, 0.0])
    verdict, index = bench.checker.pose(no_cells(bench.grid), straight_down)
    assert verdict == HIT_STATIC and bench.checker.describe(verdict, index) == "the arm would touch table"
    folded = np.array([0.0, -1.57, 2.9, 0.0, 0.0, 0.0])
    verdict, index = bench.checker.pose(no_cells(bench.grid), folded)
    assert verdict == HIT_SELF and "itself" in bench.checker.describe(verdict, index)
    swept = bench.grid.cells_of(bench.robot.tool_pose(bench.robot.home_rad)[None, :3, 3])
    verdict, index = bench.checker.pose(cells_of(bench.grid, swept), bench.robot.home_rad)
    assert verdict == HIT_CELL and index == 0


def test_immobile_bodies_do_not_meet_cells(bench):
    base = bench.grid.cells_of(np.array([[0.0, 0.0, 0.03]]))
    assert bench.checker.pose(cells_of(bench.grid, base), bench.robot.home_rad)[0] == FREE
