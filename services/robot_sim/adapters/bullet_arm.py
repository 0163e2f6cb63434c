"""The arm as a URDF that PyBullet can load: the joint frames of the robot model, convex pieces of its bodies, the tool as a link.

Written anew instead of loading the robot's own file: PyBullet would take one hull per link, knows no ``package://`` and no tool, and its
links would be the URDF's instead of the model's bodies.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from common.robot.model import RobotModel
from common.robot.solids import Body
from services.robot_sim.adapters.convex import convex_pieces

__all__ = ["frame_link", "write_urdf"]

F64 = NDArray[np.float64]
# Masses only shape how the arm takes a push: the servos are ideal. UR3 URDF: 1.3 to 2.5 g/cm3 of mesh volume.
DENSITY_KG_M3 = 1900.0
LEAST_MASS_KG = 0.05  # a joint without geometry still needs inertia
LEAST_RADIUS_M = 0.02  # likewise


def frame_link(joint: int) -> str:
    """Link name of a joint frame (0 = base)."""
    return f"frame_{joint}"


def write_urdf(robot: RobotModel, folder: Path) -> Path:
    """Write meshes and URDF into ``folder`` and return the file.

    One link per joint frame carries the mass; each body is a link of its own, named after it, fixed to its frame.
    """
    frames = [
        f'<link name="{frame_link(joint)}">{_inertial([b for b in robot.bodies if b.joint == joint])}</link>'
        for joint in range(robot.n_joints + 1)
    ]
    joints = [_joint(robot, j) for j in range(robot.n_joints)]
    bodies = [_body_link(body, i, folder) for i, body in enumerate(robot.bodies)]
    parts = [f'<robot name="{robot.name}">', *frames, *joints, *bodies, "</robot>"]
    path = folder / "arm.urdf"
    path.write_text("\n".join(parts), encoding="utf-8")
    return path


def _joint(robot: RobotModel, j: int) -> str:
    chain = robot.chain
    rpy = np.asarray(pin.rpy.matrixToRpy(chain.rotation[j]))
    kind = "prismatic" if chain.prismatic[j] else "revolute"
    low, high, speed = (float(v[j]) for v in (robot.position_min_rad, robot.position_max_rad, robot.max_velocity_rad_s))
    limits = f'lower="{low}" upper="{high}" velocity="{speed}" effort="1000"'
    return (
        f'<joint name="joint_{j + 1}" type="{kind}"><parent link="{frame_link(j)}"/><child link="{frame_link(j + 1)}"/>'
        f'<origin xyz="{_numbers(chain.translation[j])}" rpy="{_numbers(rpy)}"/>'
        f'<axis xyz="{_numbers(chain.axis[j])}"/><limit {limits}/></joint>'
    )


def _body_link(body: Body, index: int, folder: Path) -> str:
    collisions = []
    for k, corners in enumerate(convex_pieces(body)):
        path = folder / f"body_{index}_{k}.obj"
        hull = ConvexHull(corners)
        lines = [f"v {_numbers(v)}" for v in corners] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in hull.simplices]
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        collisions.append(f'<collision><geometry><mesh filename="{path}"/></geometry></collision>')
    weightless = '<inertial><mass value="0.001"/><inertia ixx="1e-6" iyy="1e-6" izz="1e-6" ixy="0" ixz="0" iyz="0"/></inertial>'
    return (
        f'<link name="{body.name}">{weightless}{"".join(collisions)}</link>'
        f'<joint name="fix_{body.name}" type="fixed"><parent link="{frame_link(body.joint)}"/><child link="{body.name}"/></joint>'
    )


def _inertial(bodies: list[Body]) -> str:
    """Mass and inertia of the bodies of a frame, each taken as the solid box around it with the mass of its mesh."""
    masses, centres, spreads = [LEAST_MASS_KG], [np.zeros(3)], [np.full(3, LEAST_RADIUS_M**2)]
    for body in bodies:
        a, b, c = (body.vertices[body.triangles[:, k]] for k in range(3))
        volume = float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum()) / 6.0
        low, high = body.vertices.min(axis=0), body.vertices.max(axis=0)
        masses.append(max(volume, 0.0) * DENSITY_KG_M3)
        centres.append((low + high) / 2.0)
        spreads.append((high - low) ** 2 / 12.0)
    mass, weights = float(np.sum(masses)), np.array(masses)[:, None]
    centre = (weights * np.array(centres)).sum(axis=0) / mass
    squares = (weights * (np.array(spreads) + (np.array(centres) - centre) ** 2)).sum(axis=0)
    ixx, iyy, izz = (squares.sum() - squares).tolist()
    return (
        f'<inertial><origin xyz="{_numbers(centre)}"/><mass value="{mass}"/>'
        f'<inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )


def _numbers(values: F64) -> str:
    return " ".join(repr(float(v)) for v in values)
