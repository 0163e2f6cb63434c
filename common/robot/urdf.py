"""A URDF file into kinematics and meshes, through pinocchio and coal (its collision geometry)."""

from __future__ import annotations

import math
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from xml.etree import ElementTree

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from common.errors import RobotError
from common.robot.solids import Body, box_mesh, cylinder_mesh, sphere_mesh

__all__ = ["load_bodies", "load_kinematics", "resolve"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
BUNDLED = "example-robot-data:"
OWN = "tolman:"
OWN_FOLDER = Path(__file__).parent / "descriptions"
BUNDLED_ROBOTS = "cmeel.prefix/share/example-robot-data/robots"
ENDLESS_RAD = 2.0 * math.pi  # either way; our choice: what a robot that counts turns from 0 to 360 degrees needs, and one from -180 to 180


def resolve(urdf: str) -> tuple[Path, list[Path]]:
    """The file of a configured URDF and the folders in which ``package://`` names are looked up.

    ``tolman:<file>`` is one of our own descriptions. ``example-robot-data:<path>`` names a file below that package's ``robots`` folder; its
    ``package://example-robot-data`` resolves against the parent of the package's share folder. For any other path the folders are
    the file's ancestors.

    Raises:
        RobotError: package or file not found.
    """
    if urdf.startswith(BUNDLED):
        try:
            robots = Path(str(distribution("example-robot-data").locate_file(BUNDLED_ROBOTS)))
        except PackageNotFoundError:
            raise RobotError(f"robot.urdf {urdf!r} needs the package example-robot-data==5.0.0") from None
        path, folders = robots / urdf.removeprefix(BUNDLED), [robots.parent.parent]
    elif urdf.startswith(OWN):
        path, folders = OWN_FOLDER / urdf.removeprefix(OWN), [OWN_FOLDER]
    else:
        path = Path(urdf).expanduser()
        folders = list(path.resolve().parents)
    if not path.is_file():
        raise RobotError(f"robot.urdf: no such file: {path}", facts={"path": str(path)})
    return path, folders


def load_kinematics(path: Path, package_dirs: list[Path], locked: dict[str, float]) -> tuple[pin.Model, pin.GeometryModel]:
    """Pinocchio's model and collision geometry with the ``locked`` joints frozen at their values.

    A joint that turns without end (continuous) gets one turn either way; a config may narrow that.

    Raises:
        RobotError: not a URDF, a mesh missing, an unknown joint to lock, or not a serial arm of one-axis joints.
    """
    try:
        text, without_speed = _with_ends(path.read_bytes())
        model = pin.buildModelFromXML(text)
        folders = [str(folder) for folder in package_dirs]
        geometry = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.COLLISION, package_dirs=folders)
    except (ValueError, RuntimeError) as error:
        raise RobotError(f"{path}: {error}", facts={"path": str(path)}) from None
    for name in without_speed:
        model.velocityLimit[model.joints[model.getJointId(name)].idx_v] = math.inf
    if locked:
        unknown = sorted(set(locked) - set(model.names))
        if unknown:
            raise RobotError(f"{path}: cannot lock unknown joints {unknown}; it has {list(model.names)[1:]}")
        reference = pin.neutral(model)
        for name, value in locked.items():
            reference[model.joints[model.getJointId(name)].idx_q] = value
        ids = [model.getJointId(name) for name in locked]
        model, geometries = pin.buildReducedModel(model, [geometry], ids, reference)
        geometry = geometries[0]
    if model.njoints < 2:
        raise RobotError(f"{path}: has no moving joint")
    for j in range(1, model.njoints):
        if model.parents[j] != j - 1 or model.joints[j].nq != 1:
            raise RobotError(
                f"{path}: joint {model.names[j]} is not part of one chain of one-axis joints; lock side joints in robot.locked_joints"
            )
    return model, geometry


def _with_ends(urdf: bytes) -> tuple[str, list[str]]:
    """A URDF whose continuous joints end after ``ENDLESS_RAD``, and those of them that it gives no greatest speed.

    Without ends pinocchio tells such a joint's place by a cosine and a sine; here joint vectors have one number a joint.
    """
    try:
        robot = ElementTree.fromstring(urdf)  # in the encoding that it names
    except ElementTree.ParseError as error:
        raise ValueError(f"not XML: {error}") from None
    without_speed = []
    for joint in robot.iter("joint"):
        if joint.get("type") != "continuous":
            continue
        joint.set("type", "revolute")
        limit = joint.find("limit")
        if limit is None:
            limit = ElementTree.SubElement(joint, "limit")
        if limit.get("velocity") is None:
            without_speed.append(joint.get("name", ""))
        limit.attrib = {"velocity": "0", "effort": "0"} | limit.attrib | {"lower": str(-ENDLESS_RAD), "upper": str(ENDLESS_RAD)}
    return ElementTree.tostring(robot, encoding="unicode"), without_speed


def load_bodies(model: pin.Model, geometry: pin.GeometryModel, immobile_links: list[str]) -> list[Body]:
    """One body for each joint frame that carries geometry: the union of its links' collision meshes.

    Raises:
        RobotError: a geometry without triangles, or ``immobile_links`` names no link of this arm.
    """
    links = {model.frames[g.parentFrame].name for g in geometry.geometryObjects}
    unknown = sorted(set(immobile_links) - links)
    if unknown:
        raise RobotError(f"robot.immobile_links: {unknown} carry no geometry; links that do: {sorted(links)}")
    if not any(g.parentJoint > 0 for g in geometry.geometryObjects):
        raise RobotError("robot.urdf: no moving link has collision geometry: nothing could be checked")
    bodies = []
    for joint in range(model.njoints):
        parts = [g for g in geometry.geometryObjects if g.parentJoint == joint]
        if not parts:
            continue
        names = [model.frames[g.parentFrame].name for g in parts]
        vertices, triangles, count = [], [], 0
        for part in parts:
            v, t = _mesh(part)
            placement = part.placement
            vertices.append(v @ placement.rotation.T + placement.translation)
            triangles.append(t + count)
            count += len(v)
        immobile = joint == 0 or all(name in immobile_links for name in names)
        bodies.append(Body(names[0], joint, np.vstack(vertices), np.vstack(triangles).astype(np.int32), immobile))
    return bodies


def _mesh(part: pin.GeometryObject) -> tuple[F64, I32]:
    shape = part.geometry
    if isinstance(shape, coal.Box):
        return box_mesh(2.0 * np.asarray(shape.halfSide))
    if isinstance(shape, coal.Cylinder):
        return cylinder_mesh(shape.radius, 2.0 * shape.halfLength)
    if isinstance(shape, coal.Sphere):
        return sphere_mesh(shape.radius)
    if not hasattr(shape, "num_tris") or shape.num_tris == 0:
        raise RobotError(f"link geometry {part.name}: {type(shape).__name__} has no triangles")
    vertices = np.array(shape.vertices(), dtype=np.float64)
    triangles = np.array([[t[0], t[1], t[2]] for t in (shape.tri_indices(i) for i in range(shape.num_tris))], dtype=np.int32)
    return vertices, triangles
