"""What the tables say of two bodies' distance: never more than it is, and mostly enough."""

from __future__ import annotations

import coal
import numpy as np

from common.robot.pair_tables import NO_TABLE, build_pair_tables, table_distance
from common.robot.pairs import coal_mesh
from tests.support.cell import ur3


def test_pairs_two_joints_apart_have_tables_and_others_have_none():
    robot = ur3()
    joints = robot.grids.body_joint
    for p, (a, b) in enumerate(robot.pairs):
        assert (robot.pair_tables.table[p] != NO_TABLE) == (abs(joints[a] - joints[b]) == 2)
        if robot.pair_tables.table[p] != NO_TABLE:
            assert robot.pair_tables.first_joint[p] == min(joints[a], joints[b])


def test_a_table_never_says_more_than_the_distance_of_the_meshes():
    robot = ur3()
    rng = np.random.default_rng(0)
    meshes = [coal_mesh(body) for body in robot.bodies]
    with_table = np.flatnonzero(robot.pair_tables.table != NO_TABLE)
    tells = grazing = 0
    for q in rng.uniform(robot.position_min_rad, robot.position_max_rad, size=(150, robot.n_joints)):
        frames = robot.joint_poses(q[None])[0]
        for p in with_table:
            joints = [robot.bodies[b].joint for b in robot.pairs[p]]
            poses = [coal.Transform3s(np.ascontiguousarray(frames[j][:3, :3]), frames[j][:3, 3]) for j in joints]
            one, other = (meshes[b] for b in robot.pairs[p])
            true = coal.distance(one, poses[0], other, poses[1], coal.DistanceRequest(), coal.DistanceResult())
            told = table_distance(robot.pair_tables, p, q)
            assert told <= true + 1e-6
            tells += told > 0.0
            grazing += true > 0.01 and told <= 0.0
    assert tells > 0.6 * 150 * len(with_table), "a table that never tells saves nothing"
    assert grazing == 0, "bodies a centimetre apart are known to be"


def test_a_table_is_the_same_each_time():
    robot = ur3()
    kept, p = robot.pair_tables, int(np.flatnonzero(robot.pair_tables.table != NO_TABLE)[-1])
    again = build_pair_tables(robot.bodies, robot.chain, robot.grids, robot.pairs[p : p + 1])
    assert again.table.tolist() == [0] and again.first_joint[0] == kept.first_joint[p]
    np.testing.assert_array_equal(again.distance_m[0], kept.distance_m[kept.table[p]])
