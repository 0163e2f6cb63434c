"""The scene as in the paper's figure: arm, table and bins; voxels yellow, planned path green, driven path cyan."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LightSource, to_rgb
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import NDArray

from clients.demo.arm import Arm
from clients.demo.moment import Moment
from common.cell import SolidConfig
from common.robot.solids import box_mesh, mesh_of_solid

__all__ = ["draw", "draw_into"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
Mesh = tuple[F64, I32, str]

TABLE, BINS, ARM, VOXELS = "#f1ede4", "#cfc6b4", "#8d9db8", "#ffc61a"
PLANNED, DRIVEN = "#1f9d4d", "#00b4e0"
LIGHT = LightSource(azdeg=120, altdeg=55)
ELEVATION_DEG, AZIMUTH_DEG = 27.0, 28.0  # our choice: from the far side, over the bins
LIMITS_M = np.array([[-0.25, 0.70], [-0.55, 0.55], [-0.12, 0.48]])  # at the least: table and bins
WALL_SUBDIVISIONS = 4


def draw(moment: Moment, arm: Arm, fixed: Sequence[SolidConfig], path: Path) -> None:
    """Save the picture; the suffix of ``path`` chooses the format."""
    figure = Figure(figsize=(9.6, 6.6), dpi=130)
    FigureCanvasAgg(figure)
    axes: Any = figure.add_axes((0.0, 0.0, 1.0, 1.0), projection="3d", computed_zorder=False)
    draw_into(axes, moment, arm, fixed)
    axes.plot([], [], color=VOXELS, linewidth=8, label="seen by the cameras")
    figure.legend(loc="lower left", frameon=False, fontsize=12)  # of the figure: in its corner, where nothing is drawn
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


def draw_into(axes: Any, moment: Moment, arm: Arm, fixed: Sequence[SolidConfig]) -> None:
    """Draw a moment into 3-D axes that were made with ``computed_zorder=False``."""
    _add_table(axes)
    meshes = [*_bins(fixed), *_voxels(moment), *_arm(moment.q_rad, arm)]
    ways = [arm.tool_positions(q) for q in (moment.planned_q_rad, moment.driven_q_rad) if len(q)]
    _add_meshes(axes, meshes)
    _add_path(axes, arm, moment.planned_q_rad, PLANNED, "planned")
    _add_path(axes, arm, moment.driven_q_rad, DRIVEN, "driven")
    limits_m = _limits_m([*(vertices for vertices, _, _ in meshes), *ways])
    axes.set(xlim=limits_m[0], ylim=limits_m[1], zlim=limits_m[2])
    axes.set_box_aspect(limits_m[:, 1] - limits_m[:, 0], zoom=1.3)
    axes.view_init(elev=ELEVATION_DEG, azim=AZIMUTH_DEG)
    axes.set_axis_off()


def _limits_m(shown_m: Sequence[F64]) -> F64:
    """(3, 2) lowest and highest of all that is shown (points (n, 3)), so that no way leaves the picture."""
    points = np.vstack(shown_m)
    return np.stack([np.minimum(LIMITS_M[:, 0], points.min(axis=0)), np.maximum(LIMITS_M[:, 1], points.max(axis=0))], axis=1)


def _bins(fixed: Sequence[SolidConfig]) -> Iterator[Mesh]:
    for solid in fixed:
        if solid.name != "table":
            vertices, triangles = mesh_of_solid(solid)
            corners = _subdivided(vertices[triangles])
            yield corners.reshape(-1, 3), np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3), BINS


def _subdivided(corners: F64) -> F64:
    """Triangles (F, 3, 3) cut into small ones: matplotlib sorts whole faces, and large ones come out in the wrong order."""
    for _ in range(WALL_SUBDIVISIONS):
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        ab, bc, ca = (a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0
        corners = np.concatenate([np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return corners


def _voxels(moment: Moment) -> Iterator[Mesh]:
    vertices, triangles = box_mesh([0.94 * moment.resolution_m] * 3)
    for centre in moment.cells_m:
        yield vertices + centre, triangles, VOXELS


def _arm(q_rad: F64, arm: Arm) -> Iterator[Mesh]:
    frames = arm.model.joint_poses(q_rad[None])[0]
    for body in arm.model.bodies:
        T = frames[body.joint]
        yield body.vertices @ T[:3, :3].T + T[:3, 3], body.triangles, ARM


def _add_table(axes: Any) -> None:
    (x0, x1), (y0, y1), _ = LIMITS_M
    corners = np.array([[x0, y0, 0.0], [x1, y0, 0.0], [x1, y1, 0.0], [x0, y1, 0.0]])
    axes.add_collection3d(Poly3DCollection([corners], facecolors=TABLE, edgecolors=BINS, zorder=0, clip_on=False))


def _add_meshes(axes: Any, meshes: Sequence[Mesh]) -> None:
    """All in one collection: matplotlib sorts faces by depth within a collection only."""
    faces, colours = [], []
    for vertices, triangles, colour in meshes:
        corners = vertices[triangles]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        shade = 0.5 + 0.5 * np.clip(normals @ LIGHT.direction, 0.0, 1.0)
        faces.append(corners)
        colours.append(shade[:, None] * np.asarray(to_rgb(colour)))
    rgb = np.vstack(colours)
    axes.add_collection3d(Poly3DCollection(np.vstack(faces), facecolors=rgb, edgecolors=rgb, linewidths=0.2, zorder=2, clip_on=False))


def _add_path(axes: Any, arm: Arm, q_rad: F64, colour: str, label: str) -> None:
    if len(q_rad):
        points = arm.tool_positions(q_rad)
        axes.plot(*points.T, color=colour, linewidth=3.5, label=label, zorder=3, solid_capstyle="round", clip_on=False)
