from __future__ import annotations

import coal
import numpy as np
import pytest

from common.robot.kernels import FAR, body_distance
from common.robot.model import load_robot
from common.robot.pairs import coal_mesh
from common.robot.solids import Body, _surface_samples, cylinder_mesh, sphere_mesh
from tests.support.cell import ur3_cell


@pytest.fixture(scope="module")
def robot():
    return load_robot(ur3_cell().robot)


def test_distance_grids_never_say_more_than_the_truth_and_little_less(robot):
    rng = np.random.default_rng(0)
    point = coal.Sphere(1e-6)
    gaps = []
    for b, body in enumerate(robot.bodies):
        mesh = coal_mesh(body)
        low, high = body.vertices.min(axis=0) - 0.05, body.vertices.max(axis=0) + 0.05
        for p in rng.uniform(low, high, size=(60, 3)):
            stored = body_distance(robot.grids, b, *p)
            true = coal.distance(
                mesh, coal.Transform3s(), point, coal.Transform3s(np.eye(3), p), coal.DistanceRequest(), coal.DistanceResult()
            )
            if stored < 0.0:
                continue  # inside, where coal's meshes know surfaces only
            assert stored <= true + 1e-4
            if stored < FAR:
                gaps.append(true - stored)
    assert len(gaps) > 100
    assert max(gaps) < 0.0095  # voxel of 5 mm: rounding by its diagonal, and a tenth of a millimetre


def test_spheres_cover_the_outer_surface(robot):
    grids = robot.grids
    for b, body in enumerate(robot.bodies):
        groups = slice(grids.group_offset[b], grids.group_offset[b + 1])
        first, last = grids.group_sphere_offset[groups.start], grids.group_sphere_offset[groups.stop]
        spheres = grids.spheres_m[first:last]
        # The convex hull's corners are on the outer surface whatever cavities the mesh has.
        from scipy.spatial import ConvexHull

        outer = body.vertices[ConvexHull(body.vertices).vertices]
        gap = np.linalg.norm(outer[:, None] - spheres[None, :, :3], axis=2) - spheres[None, :, 3]
        assert gap.min(axis=1).max() <= 1e-9, body.name


def test_groups_hold_their_spheres(robot):
    grids = robot.grids
    for g in range(len(grids.group_m)):
        spheres = grids.spheres_m[grids.group_sphere_offset[g] : grids.group_sphere_offset[g + 1]]
        reach = np.linalg.norm(spheres[:, :3] - grids.group_m[g, :3], axis=1) + spheres[:, 3]
        assert reach.max() <= grids.group_m[g, 3] + 1e-12


def test_pairs_leave_out_neighbours_and_keep_what_can_touch(robot):
    names = [body.name for body in robot.bodies]
    pairs = {(names[a], names[b]) for a, b in robot.pairs}
    assert ("base_link", "shoulder_link") not in pairs
    assert ("wrist_3_link", "tool") not in pairs
    assert ("base_link", "tool") in pairs
    assert ("upper_arm_link", "wrist_2_link") in pairs


@pytest.mark.parametrize(("mesh", "radius"), [(cylinder_mesh(0.05, 0.2), 0.05), (sphere_mesh(0.05), 0.05)])
def test_round_meshes_contain_the_round_thing(mesh, radius):
    vertices, triangles = mesh
    middles = vertices[triangles].mean(axis=1)
    side = np.abs(middles[:, 2]) < 0.099
    axis = slice(0, 2) if np.ptp(vertices[:, 2]) > 0.15 else slice(0, 3)
    assert np.linalg.norm(middles[side][:, axis], axis=1).min() >= radius - 1e-12
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    assert np.einsum("ij,ij->i", np.cross(b - a, c - a), middles).min() > 0.0  # outward


def test_surface_samples_leave_no_gap():
    vertices, triangles = cylinder_mesh(0.03, 0.05)
    body = Body("c", 0, vertices, triangles, False)
    samples = _surface_samples(body)
    rng = np.random.default_rng(1)
    weights = rng.dirichlet([1, 1, 1], size=(len(triangles), 20))
    points = np.einsum("twk,tkx->twx", weights, vertices[triangles]).reshape(-1, 3)
    gap = np.linalg.norm(points[:, None] - samples[None], axis=2).min(axis=1)
    assert gap.max() <= 0.0025
