"""The arm among cells as coal sees it, through pinocchio: one call into C++ a pose."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from benchmarks.peers.cells import merged_boxes
from benchmarks.peers.hulls import Piece, convex_pieces
from benchmarks.peers.peer import Setting
from common.cell import SolidConfig
from common.geometry.transforms import rpy_matrix
from common.robot.kernels import Chain
from common.robot.solids import Body

__all__ = ["CoalArm", "CoalWorld", "pinocchio_model"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]


class CoalArm:
    """Convex pieces of the arm and the exact static layer, made once; :meth:`world` adds the cells of a question.

    Cells: merged into boxes, all of them in one dynamic AABB tree with the arm's pieces. Measured on questions of the set ``task``, a
    check of a free pose: 15 us; without the tree 37 us; the cells as one octree 16 us, as one triangle mesh 19 us. Exact answers are the
    same in all three. A world costs about 1 ms.
    """

    def __init__(self, setting: Setting) -> None:
        self._setting = setting
        self.model = pinocchio_model(setting.robot.chain)
        self._fixed = pin.GeometryModel()
        self._pieces: list[list[int]] = []
        for body in setting.robot.bodies:
            self._pieces.append([self._add(f"{body.name}_{k}", body, piece) for k, piece in enumerate(convex_pieces(body))])
        for a, b in setting.robot.pairs:
            self._add_pairs(self._fixed, self._pieces[a], self._pieces[b])
        self._n_self = len(self._fixed.collisionPairs)
        for solid in setting.static:
            placed = pin.SE3(rpy_matrix(solid.position_m, solid.rpy_rad))
            self._add_thing(self._fixed, pin.GeometryObject(solid.name, 0, placed, _shape(solid)))
        self._n_fixed = len(self._fixed.collisionPairs)

    def world(self, cells: I32) -> CoalWorld:
        """What is free when ``cells`` (C,) are occupied."""
        geometry = pin.GeometryModel(self._fixed)
        for k, (low, high) in enumerate(merged_boxes(self._setting.grid, cells)):
            placed = pin.SE3(np.eye(3), (low + high) / 2.0)
            self._add_thing(geometry, pin.GeometryObject(f"cells_{k}", 0, placed, coal.Box(*(high - low))))
        data = geometry.createData()
        margins = self._setting.margins
        for k, request in enumerate(data.collisionRequests):
            request.security_margin = margins.self_m if k < self._n_self else margins.static_m if k < self._n_fixed else margins.safety_m
        return CoalWorld(self.model, geometry, data)

    def _add(self, name: str, body: Body, piece: Piece) -> int:
        chain = self._setting.robot.chain
        placed = pin.SE3.Identity() if body.joint else pin.SE3(chain.base_rotation, chain.base_translation)
        points = coal.StdVec_Vec3s()
        points.extend(list(piece[0]))
        hull = coal.Convex.convexHull(points, True, "Qt")
        return int(self._fixed.addGeometryObject(pin.GeometryObject(name, body.joint, placed, hull)))

    def _add_thing(self, geometry: pin.GeometryModel, thing: pin.GeometryObject) -> None:
        index = geometry.addGeometryObject(thing)
        for body, pieces in zip(self._setting.robot.bodies, self._pieces, strict=True):
            if not body.immobile:
                self._add_pairs(geometry, pieces, [index])

    @staticmethod
    def _add_pairs(geometry: pin.GeometryModel, some: list[int], others: list[int]) -> None:
        for a in some:
            for b in others:
                geometry.addCollisionPair(pin.CollisionPair(a, b))


class CoalWorld:
    """The arm among the cells of one question."""

    def __init__(self, model: pin.Model, geometry: pin.GeometryModel, data: pin.GeometryData) -> None:
        self._model, self._kinematics = model, model.createData()
        self._geometry, self._data = geometry, data  # the tree holds only references
        self._tree = pin.BroadPhaseManager_DynamicAABBTreeCollisionManager(model, geometry, data)

    def is_free(self, q_rad: F64) -> bool:
        """Whether the pose ``q_rad`` (J,) keeps all distances."""
        return not pin.computeCollisions(self._model, self._kinematics, self._tree, q_rad, True)


def pinocchio_model(chain: Chain) -> pin.Model:
    """A chain as pinocchio's model; its frame 0 is the world, not the base."""
    model = pin.Model()
    parent = 0
    for j in range(len(chain.axis)):
        placed = pin.SE3(chain.rotation[j], chain.translation[j])
        if j == 0:
            placed = pin.SE3(chain.base_rotation, chain.base_translation) * placed
        parent = model.addJoint(parent, _joint(chain.axis[j], bool(chain.prismatic[j])), placed, f"joint_{j + 1}")
    return model


def _joint(axis: F64, slides: bool) -> pin.JointModel:
    along = [k for k in range(3) if np.array_equal(axis, np.eye(3)[k])]
    if along:  # pinocchio is faster along a frame's own axes
        kinds = (pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ) if slides else (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ)
        return kinds[along[0]]()
    return pin.JointModelPrismaticUnaligned(axis) if slides else pin.JointModelRevoluteUnaligned(axis)


def _shape(solid: SolidConfig) -> coal.CollisionGeometry:
    kinds = {"box": coal.Box, "cylinder": coal.Cylinder, "sphere": coal.Sphere}
    return kinds[solid.shape](*solid.size_m)
