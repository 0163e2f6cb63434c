"""The arm as a URDF for roboplan: convex pieces as its collision shapes, static layer grown, pairs and limits as ours."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray
from roboplan.core import Scene, loadUrdfSceneDescriptionFromXml
from scipy.spatial.transform import Rotation

from benchmarks.peers.hulls import Piece, convex_pieces
from benchmarks.peers.peer import Setting
from common.cell import SolidConfig
from common.geometry.transforms import rpy_matrix
from common.robot.solids import Body

__all__ = ["FIXTURES", "link_name", "make_scene"]

F64 = NDArray[np.float64]

FIXTURES = "fixtures"  # the link that carries the static layer
STL_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])


def link_name(body: Body) -> str:
    """Name of the link that carries a body's pieces."""
    return f"body_{body.name}"


def make_scene(setting: Setting) -> Scene:
    """roboplan's scene without cells: arm, static layer grown by its margin, collisions allowed where ours are."""
    with TemporaryDirectory() as folder:
        scene = Scene("peers", loadUrdfSceneDescriptionFromXml(_urdf(setting, Path(folder))))
    bodies = setting.robot.bodies
    wanted = {frozenset((link_name(bodies[a]), link_name(bodies[b]))) for a, b in setting.robot.pairs}
    wanted |= {frozenset((FIXTURES, link_name(body))) for body in bodies if not body.immobile}
    pairs = combinations([FIXTURES, *(link_name(body) for body in bodies)], 2)
    scene.setCollisions([pair for pair in pairs if frozenset(pair) not in wanted], False)
    return scene


def _urdf(setting: Setting, folder: Path) -> str:
    robot, chain = setting.robot, setting.robot.chain
    lines = ['<robot name="arm">', '<link name="world"/>', f'<link name="{FIXTURES}">']
    lines += [_grown(solid, setting.margins.static_m) for solid in setting.static]
    lines += ["</link>", _joint("fixtures_joint", "fixed", "world", FIXTURES), '<link name="frame_0"/>']
    lines.append(_joint("base_joint", "fixed", "world", "frame_0", _origin(chain.base_rotation, chain.base_translation)))
    for j, name in enumerate(robot.joint_names):
        kind = "prismatic" if chain.prismatic[j] else "revolute"
        limits = f'lower="{robot.position_min_rad[j]!s}" upper="{robot.position_max_rad[j]!s}" velocity="1" effort="1"'
        inside = f'{_origin(chain.rotation[j], chain.translation[j])}<axis xyz="{_numbers(chain.axis[j])}"/><limit {limits}/>'
        lines += [f'<link name="frame_{j + 1}"/>', _joint(name, kind, f"frame_{j}", f"frame_{j + 1}", inside)]
    for body in robot.bodies:
        lines += [_link(body, convex_pieces(body), folder)]
        lines += [_joint(f"{body.name}_joint", "fixed", f"frame_{body.joint}", link_name(body))]
    return "\n".join([*lines, "</robot>"])


def _joint(name: str, kind: str, parent: str, child: str, inside: str = "") -> str:
    ends = f"<parent link={quoteattr(parent)}/><child link={quoteattr(child)}/>"
    return f'<joint name={quoteattr(name)} type="{kind}">{ends}{inside}</joint>'


def _link(body: Body, pieces: list[Piece], folder: Path) -> str:
    """``collision_checking`` is pinocchio's own: take the mesh as a convex solid instead of as a soup of triangles."""
    names = [f"{link_name(body)}_{k}" for k in range(len(pieces))]
    shapes = []
    for name, piece in zip(names, pieces, strict=True):
        path = folder / f"{len(list(folder.iterdir()))}.stl"
        path.write_bytes(_stl(piece))
        mesh = f"<geometry><mesh filename={quoteattr(f'file://{path}')}/></geometry>"
        shapes.append(f"<collision name={quoteattr(name)}>{mesh}</collision>")
    convex = "".join(f"<convex name={quoteattr(name)}/>" for name in names)
    return f"<link name={quoteattr(link_name(body))}>{''.join(shapes)}<collision_checking>{convex}</collision_checking></link>"


def _grown(solid: SolidConfig, margin_m: float) -> str:
    if solid.shape == "box":
        shape = f'<box size="{_numbers(np.array(solid.size_m) + 2.0 * margin_m)}"/>'
    elif solid.shape == "cylinder":
        shape = f'<cylinder radius="{solid.size_m[0] + margin_m}" length="{solid.size_m[1] + 2.0 * margin_m}"/>'
    else:
        shape = f'<sphere radius="{solid.size_m[0] + margin_m}"/>'
    T = rpy_matrix(solid.position_m, solid.rpy_rad)
    return f"<collision name={quoteattr(solid.name)}>{_origin(T[:3, :3], T[:3, 3])}<geometry>{shape}</geometry></collision>"


def _origin(rotation: F64, translation: F64) -> str:
    rpy = Rotation.from_matrix(rotation).as_euler("xyz", suppress_warnings=True)
    return f'<origin xyz="{_numbers(translation)}" rpy="{_numbers(rpy)}"/>'


def _numbers(values: F64) -> str:
    return " ".join(repr(float(value)) for value in values)


def _stl(piece: Piece) -> bytes:
    """Binary STL: header of 80 bytes, number of triangles, triangles of 50 bytes."""
    vertices, triangles = piece
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    data = np.zeros(len(triangles), dtype=STL_TRIANGLE)
    data["normal"] = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    data["corners"] = np.stack([a, b, c], axis=1)
    return bytes(80) + np.uint32(len(triangles)).tobytes() + data.tobytes()
