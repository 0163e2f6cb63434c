"""The arm and the static layer as the checks see them: flat arrays, with the bounds by which most looks are saved."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from common.cell import SolidConfig
from common.geometry.transforms import rpy_matrix
from common.robot.model import RobotModel
from services.planner.kernels.collision import Arm
from services.planner.kernels.static_layer import BOX, CYLINDER, NO_SOLIDS, SPHERE, Field, Solids, fill_field

__all__ = ["arm_of", "body_levers", "pair_levers", "placed_solids", "solids_of", "world_reach_m"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
FIELD_SPACING_M = 0.01  # our choice: 1 m^3 of it is four megabytes
# Bodies two joints apart may stand a centimetre from one another by construction, in whatever pose; the bounds of the check take up to 3 mm
# of that. Where a pair usually has less than so many margins, it keeps the near one. Our choice; measured: of the start and goal poses of
# 490 UR5 problems a margin of 5 mm for such pairs forbids 1.8 %, 2 mm 0.7 %, 1 mm 0.3 %, none 0.2 %.
NEAR_MARGINS = 2.0
# The physics engine adds 1 mm to each mesh. Measured on 34 000 free segments of a UR5, at every 4 mrad of them: nearest 3.1 mm by the
# meshes and 0.6 mm by the engine; with 1 mm 2.3 and 0.2; with none 1.1 and touching.
NEAR_MARGIN_M = 0.002
FIELD_MARGIN_M = 0.1  # the voxels go so far beyond the solids, where their common box tells enough; our choice


def arm_of(robot: RobotModel, *, static_margin_m: float, self_margin_m: float) -> Arm:
    """The arm as the checks see it; immobile bodies stand in the world and are left out against cells and static layer.

    ``self_margin_m`` is kept by pairs of bodies that usually have room for it, ``NEAR_MARGIN_M`` at most by the others.
    """
    lever_m = body_levers(robot)
    near = robot.pair_usual_m <= NEAR_MARGINS * self_margin_m
    return Arm(
        chain=robot.chain,
        grids=robot.grids,
        moving=np.array([not body.immobile for body in robot.bodies], dtype=np.uint8),
        pairs=robot.pairs,
        pair_tables=robot.pair_tables,
        static_margin_m=float(static_margin_m),
        pair_margin_m=np.where(near, min(NEAR_MARGIN_M, self_margin_m), float(self_margin_m)),
        lever_m=lever_m,
        pair_lever_m=pair_levers(robot, lever_m),
    )


def body_levers(robot: RobotModel) -> F64:
    """(B, J) farthest that any point of a body moves, in metres per radian (or metre) of a joint, in any pose.

    A point turns about a joint at no more than its distance from that joint's frame, which is at most the sum of the links between.
    """
    chain, grids = robot.chain, robot.grids
    slides_m = np.where(chain.prismatic > 0, np.maximum(np.abs(robot.position_min_rad), np.abs(robot.position_max_rad)), 0.0)
    link_m = np.linalg.norm(chain.translation, axis=1)  # from each joint's frame to the one before
    own_m = np.linalg.norm(grids.bound_centre_m, axis=1) + grids.bound_radius_m
    lever = np.zeros((len(grids.body_joint), len(chain.axis)))
    for b, frame in enumerate(grids.body_joint):
        for j in range(int(frame)):  # joint j moves frame j + 1
            arm_m = own_m[b] + link_m[j + 1 : frame].sum() + slides_m[j + 1 : frame].sum()
            lever[b, j] = 1.0 if chain.prismatic[j] else arm_m + slides_m[j]
    return lever


def pair_levers(robot: RobotModel, lever_m: F64) -> F64:
    """(P, J) the same for one body of a pair as seen from the other: only the joints between them count."""
    pair_lever = np.zeros((len(robot.pairs), lever_m.shape[1]))
    for p, pair in enumerate(robot.pairs):
        near, far = sorted(pair, key=lambda b: int(robot.grids.body_joint[b]))
        between = slice(int(robot.grids.body_joint[near]), int(robot.grids.body_joint[far]))
        pair_lever[p, between] = lever_m[far, between]
    return pair_lever


def solids_of(static: Sequence[SolidConfig], field_m: float = FIELD_SPACING_M) -> Solids:
    """The static layer as arrays, with its field of distances, of voxels with edges of ``field_m``.

    What the field says can be coarse, then the shapes themselves are asked more often: no verdict depends on it.
    """
    if not static:
        return NO_SOLIDS
    placed = placed_solids(static)
    field = _empty_field(static, placed[2], placed[3], field_m)
    solids = Solids(*placed, field)
    fill_field(solids, field)
    return solids


def placed_solids(static: Sequence[SolidConfig]) -> tuple[I64, F64, F64, F64]:
    """Kind, size, rotation and translation of each of S >= 1 solids, as in :class:`~services.planner.kernels.static_layer.Solids`."""
    kinds = {"box": BOX, "sphere": SPHERE, "cylinder": CYLINDER}
    n = len(static)
    size, rotation, translation = np.zeros((n, 3)), np.zeros((n, 3, 3)), np.zeros((n, 3))
    for i, solid in enumerate(static):
        T = rpy_matrix(solid.position_m, solid.rpy_rad)
        rotation[i], translation[i] = T[:3, :3], T[:3, 3]
        if solid.shape == "box":
            size[i] = np.asarray(solid.size_m) / 2.0
        elif solid.shape == "cylinder":
            size[i, :2] = solid.size_m[0], solid.size_m[1] / 2.0
        else:
            size[i, 0] = solid.size_m[0]
    return np.array([kinds[s.shape] for s in static], dtype=np.int64), size, rotation, translation


def world_reach_m(static: Sequence[SolidConfig], rotation: F64) -> F64:
    """(S, 3) half the edges of the box along the world's axes that contains a solid turned by ``rotation`` (S, 3, 3)."""
    half = np.array([_half_extent_m(solid) for solid in static])
    return np.asarray(np.einsum("sab,sb->sa", np.abs(rotation), half))


def _empty_field(static: Sequence[SolidConfig], rotation: F64, translation: F64, field_m: float) -> Field:
    reach = world_reach_m(static, rotation)
    low, high = (translation - reach).min(axis=0), (translation + reach).max(axis=0)
    shape = np.ceil((high - low + 2.0 * FIELD_MARGIN_M) / field_m).astype(np.int64)
    return Field(np.empty(int(np.prod(shape)), dtype=np.float32), low - FIELD_MARGIN_M, shape, field_m, low, high)


def _half_extent_m(solid: SolidConfig) -> list[float]:
    """Half the edges of the box around a shape, in its own frame."""
    if solid.shape == "box":
        return [edge / 2.0 for edge in solid.size_m]
    radius = solid.size_m[0]
    return [radius, radius, solid.size_m[1] / 2.0 if solid.shape == "cylinder" else radius]
