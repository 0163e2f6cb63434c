"""A box in the gripper as a body of the arm."""

from __future__ import annotations

import numpy as np
import pytest

from common.errors import RequestError
from common.robot.payload import PAYLOAD, Payload, joined_grids, with_payload
from common.robot.solids import Body, box_mesh, build_grids
from tests.support.cell import ur3


def test_joined_grids_equal_grids_built_together() -> None:
    bodies = [Body(name, joint, *box_mesh(size), False) for name, joint, size in (("a", 1, [0.1, 0.04, 0.04]), ("b", 2, [0.05, 0.05, 0.2]))]
    together, joined = build_grids(tuple(bodies), 0.005), joined_grids(build_grids((bodies[0],), 0.005), build_grids((bodies[1],), 0.005))
    for name, one, other in zip(together._fields, together, joined, strict=True):
        np.testing.assert_array_equal(one, other, err_msg=name)


def test_the_box_moves_with_the_tool_and_is_checked_against_all_but_what_holds_it() -> None:
    bare = ur3()
    held = with_payload(bare, Payload((0.05, 0.06, 0.1), (0.0, 0.0, 0.02)))
    box = held.bodies[-1]
    assert box.name == PAYLOAD and box.joint == bare.n_joints
    frame = held.joint_poses(held.home_rad[None])[0, -1]
    middle = frame[:3, :3] @ box.vertices.mean(axis=0) + frame[:3, 3]
    tool = bare.tool_pose(bare.home_rad)
    assert middle == pytest.approx(tool[:3, 3] + 0.02 * tool[:3, 2])
    others = {held.bodies[a].name for a, b in held.pairs if b == len(held.bodies) - 1}
    assert others == {body.name for body in bare.bodies if body.joint != bare.n_joints}
    assert np.array_equal(held.pairs[: len(bare.pairs)], bare.pairs) and len(held.pair_usual_m) == len(held.pairs)
    assert held.fingerprint != bare.fingerprint
    assert held.fingerprint == with_payload(bare, Payload((0.05, 0.06, 0.1), (0.0, 0.0, 0.02))).fingerprint


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"size_m": (0.1, 0.1, 0.6)}, "size_m: .*0.6"),
        ({"size_m": (0.1, 0.0, 0.1)}, "size_m"),
        ({"size_m": (0.1, float("nan"), 0.1)}, "size_m"),
        ({"size_m": (0.1, 0.1, 0.1), "position_m": (0.0, 0.9, 0.0)}, "position_m: .*0.9"),
        ({"size_m": (0.1, 0.1, 0.1), "quaternion_xyzw": (0.0, 0.0, 0.0, 0.0)}, "quaternion_xyzw"),
    ],
)
def test_nonsense_is_refused_with_its_value(fields, words) -> None:
    with pytest.raises(RequestError, match=words):
        Payload(**fields)


def test_a_box_around_a_link_is_refused_with_its_name() -> None:
    with pytest.raises(RequestError, match="the box is in"):
        with_payload(ur3(), Payload((0.2, 0.2, 0.2), (0.0, 0.0, -0.15)))
