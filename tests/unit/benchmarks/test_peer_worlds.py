"""What peers check against is no smaller than the truth, and keeps the distances that ours keeps; the referee sees every cell."""

from __future__ import annotations

import itertools

import coal
import numpy as np
import pinocchio as pin
import pytest

from benchmarks.peers.cells import coarsest_split, grown_leaves, merged_boxes
from benchmarks.peers.coal_world import CoalArm, pinocchio_model
from benchmarks.peers.hulls import convex_pieces
from benchmarks.peers.peer import Setting
from benchmarks.peers.roboplan_scene import make_scene
from benchmarks.referee import STEP_RAD, Referee, at_steps
from common.geometry.grid import Grid
from common.robot.pairs import coal_mesh
from services.planner.config import MarginsConfig
from services.planner.offline.regions import box_cells
from tests.support.cell import ur3, ur3_cell

SMALL = Grid((-0.1, 0.2, 0.0), (7, 6, 5), 0.02)
NONE = np.empty(0, dtype=np.int32)


@pytest.fixture(scope="module")
def setting() -> Setting:
    return Setting.of(ur3_cell(), MarginsConfig())


@pytest.fixture(scope="module")
def cells(setting: Setting) -> np.ndarray:
    low_and_high = [([0.25, -0.08, 0.1], [0.45, 0.08, 0.5]), ([-0.3, 0.2, 0.3], [-0.1, 0.4, 0.5])]
    return np.unique(np.concatenate([box_cells(setting.grid, np.array(a), np.array(b)) for a, b in low_and_high])).astype(np.int32)


@pytest.fixture(scope="module")
def poses() -> np.ndarray:
    return np.random.default_rng(4).uniform(ur3().position_min_rad, ur3().position_max_rad, size=(300, 6))


@pytest.mark.parametrize("seed", range(5))
def test_merged_boxes_cover_every_cell_once_and_nothing_else(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cells = np.flatnonzero(rng.random(SMALL.n_cells) < rng.uniform(0.05, 0.95)).astype(np.int32)
    centres = SMALL.centres(np.arange(SMALL.n_cells))
    boxes = merged_boxes(SMALL, cells)
    covered = sum(np.all((centres > low) & (centres < high), axis=1).astype(int) for low, high in boxes)
    np.testing.assert_array_equal(np.flatnonzero(covered), cells)
    assert np.max(covered) == 1
    volume = np.prod(boxes[:, 1] - boxes[:, 0], axis=1).sum()
    assert volume == pytest.approx(len(cells) * SMALL.resolution_m**3)


def test_a_box_is_one_box_and_nothing_is_none() -> None:
    cells = box_cells(SMALL, np.array([-0.07, 0.23, 0.01]), np.array([0.01, 0.29, 0.05]))
    np.testing.assert_allclose(merged_boxes(SMALL, cells), [[[-0.08, 0.22, 0.0], [0.02, 0.3, 0.06]]], atol=1e-12)
    assert merged_boxes(SMALL, NONE).shape == (0, 2, 3)
    assert grown_leaves(SMALL, NONE, 0.02, 1).shape == (0, 3)


@pytest.mark.parametrize(("margin_m", "split"), [(0.02, 1), (0.01, 2), (0.005, 4), (0.03, 2), (0.013, 4), (0.0, 1)])
def test_grown_leaves_are_the_cells_and_all_within_the_margin_to_half_a_leaf(margin_m: float, split: int) -> None:
    rng = np.random.default_rng(9)
    cells = np.array([0, 37, 38, 121, SMALL.n_cells - 1], dtype=np.int32)
    assert coarsest_split(SMALL, margin_m) == split
    centres, leaf_m = grown_leaves(SMALL, cells, margin_m, split), SMALL.resolution_m / split
    points = rng.uniform([-0.15, 0.15, -0.05], [0.09, 0.37, 0.15], size=(1500, 3))
    gap = np.maximum(np.abs(points[:, None] - SMALL.centres(cells)) - SMALL.resolution_m / 2.0, 0.0)
    distance = np.linalg.norm(gap, axis=2).min(axis=1)
    inside = np.any(np.all(np.abs(points[:, None] - centres) <= leaf_m / 2.0 + 1e-9, axis=2), axis=1)
    half_diagonal_m = leaf_m * np.sqrt(3.0) / 2.0
    surely_m = margin_m if margin_m <= leaf_m + 1e-9 else margin_m - half_diagonal_m
    assert np.all(inside[(distance == 0.0) | (distance < surely_m)])
    assert not np.any(inside[distance > margin_m + half_diagonal_m])


def test_pieces_are_convex_contain_the_mesh_and_cut_the_long_links() -> None:
    cut = []
    for body in ur3().bodies:
        pieces = convex_pieces(body)
        cut.append(len(pieces))
        inside = np.zeros(len(body.vertices), dtype=bool)
        for vertices, triangles in pieces:
            a, b, c = (vertices[triangles[:, k]] for k in range(3))
            normal = np.cross(b - a, c - a)
            normal /= np.linalg.norm(normal, axis=1, keepdims=True)
            offset = np.einsum("fk,fk->f", normal, a)
            assert np.all(vertices @ normal.T <= offset + 1e-6)
            inside |= np.all(body.vertices @ normal.T <= offset + 1e-6, axis=1)
        assert inside.all(), body.name
    assert dict(zip([body.name for body in ur3().bodies], cut, strict=True))["upper_arm_link"] == 3
    assert sum(cut) == len(cut) + 4


def test_pinocchio_sees_the_same_arm(poses: np.ndarray) -> None:
    model = pinocchio_model(ur3().chain)
    data = model.createData()
    for q in poses[:20]:
        pin.forwardKinematics(model, data, q)
        theirs = np.array([data.oMi[j + 1].homogeneous for j in range(6)])
        np.testing.assert_allclose(theirs, ur3().joint_poses(q[None])[0, 1:], atol=1e-12)


def distances_kept(setting: Setting, meshes: list[coal.BVHModelOBBRSS], cells: np.ndarray, q: np.ndarray) -> bool:
    """The obvious check of all margins: bare meshes against one box a cell, the static layer and themselves."""
    robot, margins = setting.robot, setting.margins
    frames = robot.joint_poses(q[None])[0]
    placed = [coal.Transform3s(frames[body.joint][:3, :3].copy(), frames[body.joint][:3, 3].copy()) for body in robot.bodies]
    things = [(coal.Box(*np.full(3, setting.grid.resolution_m)), centre, margins.safety_m) for centre in setting.grid.centres(cells)]
    things += [(coal.Box(*solid.size_m), np.array(solid.position_m), margins.static_m) for solid in setting.static]
    moving = [k for k, body in enumerate(robot.bodies) if not body.immobile]
    if any(
        near(meshes[k], placed[k], shape, coal.Transform3s(np.eye(3), position), margin)
        for (shape, position, margin), k in itertools.product(things, moving)
    ):
        return False
    return not any(near(meshes[a], placed[a], meshes[b], placed[b], margins.self_m) for a, b in robot.pairs)


def near(a: coal.CollisionGeometry, at_a: coal.Transform3s, b: coal.CollisionGeometry, at_b: coal.Transform3s, margin_m: float) -> bool:
    request, result = coal.CollisionRequest(), coal.CollisionResult()
    request.security_margin = margin_m
    coal.collide(a, at_a, b, at_b, request, result)
    return bool(result.isCollision())


def test_a_pose_that_is_free_to_ompl_keeps_all_distances_and_few_others_are_lost(
    setting: Setting, cells: np.ndarray, poses: np.ndarray
) -> None:
    few = cells[:: len(cells) // 40]  # scattered cells: many boxes, and one coal box a cell is not too slow
    world, meshes = CoalArm(setting).world(few), [coal_mesh(body) for body in ur3().bodies]
    theirs = np.array([world.is_free(q) for q in poses[:150]])
    truly = np.array([distances_kept(setting, meshes, few, q) for q in poses[:150]])
    assert not np.any(theirs & ~truly)
    assert truly.sum() >= 30
    assert theirs.sum() >= 0.95 * truly.sum()


def test_a_pose_that_is_free_to_roboplan_touches_nothing(setting: Setting, poses: np.ndarray) -> None:
    scene, world = make_scene(setting), CoalArm(setting).world(NONE)
    referee = Referee(ur3(), ur3_cell().static)
    no_boxes = np.empty((0, 2, 3))
    free = np.array([not scene.hasCollisions(q) for q in poses])
    assert not any(referee.collides(q[None], no_boxes) for q in poses[free])
    assert 40 <= free.sum() <= len(poses) - 40
    differs = free != np.array([world.is_free(q) for q in poses])
    assert differs.mean() < 0.03  # no margin between the arm's own bodies; more than the margin at edges of the static layer


def test_the_referee_sees_cells_as_their_boxes(setting: Setting, cells: np.ndarray, poses: np.ndarray) -> None:
    referee = Referee(ur3(), ur3_cell().static)
    some = cells[::25]
    half = setting.grid.resolution_m / 2.0
    centres = setting.grid.centres(some)
    boxes = np.stack([centres - half, centres + half], axis=1)
    path_free = [not referee.path_collides(q[None], setting.grid, NONE) for q in poses]
    verdicts = []
    for q in poses[path_free][:60]:
        verdicts.append(referee.path_collides(q[None], setting.grid, some))
        assert verdicts[-1] == referee.collides(q[None], boxes) == referee.path_collides(q[None], setting.grid, NONE, boxes)
    assert any(verdicts) and not all(verdicts)


@pytest.mark.parametrize(("n", "scale_rad"), [(1, 1.0), (2, 1e-4), (5, 1.0), (3000, 1e-3), (500, 3e-3), (2000, 1e-2)])
def test_the_referee_looks_at_least_every_step_and_passes_no_corner_by(n: int, scale_rad: float) -> None:
    path = np.cumsum(np.random.default_rng(n).normal(scale=scale_rad, size=(n, 6)), axis=0)
    looks = at_steps(path)
    np.testing.assert_array_equal(looks[[0, -1]], path[[0, -1]])
    assert np.abs(np.diff(looks, axis=0)).max(initial=0.0) <= STEP_RAD * (1.0 + 1e-9)
    assert max(np.abs(looks - corner).max(axis=1).min() for corner in path) <= STEP_RAD
    finest = np.diff(path, axis=0)
    assert len(looks) <= 1 + np.ceil(np.abs(finest).max(axis=1) / STEP_RAD).sum(initial=0.0), "no more looks than corner by corner"


def test_what_the_referee_passes_over_could_not_touch(poses: np.ndarray) -> None:
    boxes = np.array([[[0.3, -0.1, 0.0], [0.4, 0.1, 0.4]], [[-0.5, -0.06, 0.0], [-0.4, 0.06, 0.4]]])
    quick, slow = Referee(ur3(), ur3_cell().static), Referee(ur3(), ur3_cell().static)
    slow._radius_m[:] = np.inf  # so that coal is asked about everything
    for things in (boxes, boxes[:0]):
        said = [quick.collides(q[None], things) for q in poses]
        assert said == [slow.collides(q[None], things) for q in poses]
        assert 0 < sum(said) < len(said)
