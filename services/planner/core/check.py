"""The one check, with the names of things: poses, segments and curves against cells, static layer and the arm itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.robot.kernels import forward_kinematics
from common.robot.trajectory import JointTrajectory
from services.planner.kernels.blends import fit_blends
from services.planner.kernels.cells import Cells
from services.planner.kernels.clearance import pose_clearance
from services.planner.kernels.collision import FREE, HIT_CELL, HIT_STATIC, Arm, cells_that_hit, farthest_m, pose_verdict
from services.planner.kernels.path import curve_verdict, first_blocked
from services.planner.kernels.static_layer import NO_SOLIDS, Solids
from services.planner.kernels.way import line_is_free

__all__ = ["ASTRAY_M", "TOUCH_M", "Checker", "CurveVerdict", "HandReach"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]
HAND_WINDOWS = 4  # windows of growing room; our choice
ASTRAY_M = 0.0005  # a timed curve may stray so far from the rounded path that was looked at; our choice, measured: less than 0.1 mm
TOUCH_M = 0.005  # what an arm that leaves cells keeps from a hand that may follow: the distance grids' rounding; our choice
HAND_LOOK_S = 0.3  # the fastest moment of the next so many seconds counts; our choice
CurveVerdict = tuple[int, int, float]


@dataclass(frozen=True, eq=False)
class HandReach:
    """What a hand may do while the arm comes to rest.

    Attributes:
        speed_m_s: of the hand.
        latency_s: from its motion to the arm's first braking: the wait for the next frame, and what seeing and answering take.
        acceleration_rad_s2: (J,) with which the arm brakes.
        since_seen_s: from the exposure that shows it to the beginning of the curve that is looked at.
    """

    speed_m_s: float
    latency_s: float
    acceleration_rad_s2: F64
    since_seen_s: float = 0.0

    def horizon_s(self, curve: JointTrajectory, from_s: float) -> float:
        """Time in which the arm, on ``curve`` at ``from_s``, would stand if it had to."""
        _, dq, _ = curve.sample(from_s + np.linspace(0.0, HAND_LOOK_S, 8))
        return self.latency_s + float((np.abs(dq) / self.acceleration_rad_s2).max())


class Checker:
    """Checks for one arm in one cell. Holds scratch, so one per thread.

    Args:
        arm, solids: what is checked and the static layer.
        safety_m: distance kept from cells.
        step_m: farthest that any point of the arm moves between two checked poses.
        body_names, solid_names: for reasons in words.
    """

    def __init__(self, arm: Arm, solids: Solids, *, safety_m: float, step_m: float, body_names: list[str], solid_names: list[str]) -> None:
        self.arm = arm
        self.solids = solids
        self.safety_m = safety_m
        self.step_m = step_m
        self._body_names = body_names
        self._solid_names = solid_names
        self._arm_against_cells = arm._replace(pairs=arm.pairs[:0], pair_lever_m=arm.pair_lever_m[:0])
        self._blend_arm = arm._replace(static_margin_m=arm.static_margin_m + ASTRAY_M, pair_margin_m=arm.pair_margin_m + ASTRAY_M)
        self._no_solids = NO_SOLIDS
        n_joints = len(arm.chain.axis)
        self._rotation, self._translation = np.empty((n_joints + 1, 3, 3)), np.empty((n_joints + 1, 3))

    def pose(self, cells: Cells, q_rad: F64, *, safety_m: float | None = None) -> tuple[int, int]:
        """Verdict and index of what ``q_rad`` (J,) hits."""
        safety = self.safety_m if safety_m is None else safety_m
        verdict, index = pose_verdict(self.arm, self.solids, cells, safety, q_rad, self._rotation, self._translation)
        return int(verdict), int(index)

    def cells_hit(self, cells: Cells, q_rad: F64, *, safety_m: float | None = None) -> NDArray[np.bool_]:
        """Which cells (C,) block ``q_rad`` (J,)."""
        safety = self.safety_m if safety_m is None else safety_m
        hit = np.empty(len(cells.centre_m), dtype=np.uint8)
        forward_kinematics(self.arm.chain, q_rad, self._rotation, self._translation)
        cells_that_hit(self.arm, cells, safety, self._rotation, self._translation, hit)
        return hit.astype(bool)

    def clearance(self, cells: Cells, q_rad: F64) -> float:
        """Distance in metres from ``q_rad`` (J,) to cells and static layer: never above the true one, below it by a centimetre at most.

        Infinite where there is neither; 0 where it touches.
        """
        forward_kinematics(self.arm.chain, q_rad, self._rotation, self._translation)
        return float(pose_clearance(self.arm, self.solids, cells, self._rotation, self._translation))

    def poses_meet(self, cells: Cells, q_rad: F64, *, room_m: float = 0.0) -> int | None:
        """Index of the first of the poses (K, J) that comes within the safety distance and ``room_m`` of a cell.

        Nothing else is looked at, nor what lies between the poses.
        """
        k = int(first_blocked(self.arm, cells, self.safety_m + room_m, q_rad))
        return None if k < 0 else k

    def segment(self, cells: Cells, q_a: F64, q_b: F64) -> bool:
        """Whether the straight joint segment is free."""
        return bool(line_is_free(self.arm, self.solids, cells, self.safety_m, self.step_m, q_a, q_b))

    def curve(self, cells: Cells, curve: JointTrajectory, *, from_s: float = 0.0, to_s: float = np.inf) -> CurveVerdict:
        """Verdict, index of what is hit and time of the first blocked pose of a timed curve between two of its times."""
        to_s = min(to_s, curve.duration_s)
        verdict, index, at_s, _ = curve_verdict(
            self.arm, self.solids, cells, self.safety_m, self.step_m, curve.t_s, curve.q_rad, curve.dq_rad_s, from_s, to_s
        )
        return int(verdict), int(index), float(at_s)

    def curve_meets(
        self,
        cells: Cells,
        curve: JointTrajectory,
        *,
        from_s: float = 0.0,
        to_s: float = np.inf,
        room_m: float = 0.0,
        safety_m: float | None = None,
    ) -> float | None:
        """First time at which a curve, known to be free otherwise, comes within the safety distance and ``room_m`` of ``cells``."""
        safety_m = self.safety_m if safety_m is None else safety_m
        if len(cells.centre_m) == 0:
            return None
        verdict, _, at_s, _ = curve_verdict(
            self._arm_against_cells, self._no_solids, cells, safety_m + room_m, self.step_m,
            curve.t_s, curve.q_rad, curve.dq_rad_s, from_s, min(to_s, curve.duration_s),
        )  # fmt: skip
        return None if verdict == FREE else float(at_s)

    def hand_meets(
        self, recent: Cells, curve: JointTrajectory, reach: HandReach, *, from_s: float = 0.0, safety_m: float | None = None
    ) -> float | None:
        """First time at which something that moves could come within ``safety_m`` before the arm can stand; None if nothing could.

        What was seen at an exposure may be ``speed`` times t nearer a time t after it. Beyond the horizon there is time to see it and to
        stop, so only the near part of the curve is looked at, in windows of growing room.
        """
        if len(recent.flat) == 0:
            return None
        horizon = reach.horizon_s(curve, from_s)
        window = horizon / HAND_WINDOWS
        for k in range(HAND_WINDOWS):
            begin, room_m = from_s + k * window, reach.speed_m_s * (reach.since_seen_s + (k + 1) * window)
            met = self.curve_meets(recent, curve, from_s=begin, to_s=begin + window, room_m=room_m, safety_m=safety_m)
            if met is not None:
                return met
        return None

    def fit_blends(self, cells: Cells, path_rad: F64, proven: U8, share: float) -> tuple[F64, int]:
        """How far from each corner of a path (P, J) it may be rounded (:mod:`services.planner.kernels.blends`).

        ``proven`` (P - 1,): pieces that are known to be free.

        Returns:
            (P,) rad, and the first piece that is not free, or -1: the rounded path is free, its blends by ``ASTRAY_M`` more.
        """
        reach = np.empty(len(path_rad))
        blocked = fit_blends(
            self.arm, self._blend_arm, self.solids, cells, self.safety_m, ASTRAY_M, self.step_m, path_rad, proven, share, reach
        )  # fmt: skip
        return reach, int(blocked)

    def strays_m(self, astray_rad: F64) -> float:
        """How far in metres any point of the arm can be from where it should be if each joint is off by at most ``astray_rad`` (J,)."""
        return float(farthest_m(self.arm, astray_rad))

    def describe(self, verdict: int, index: int) -> str:
        """What a verdict means, in words."""
        if verdict == HIT_CELL:
            return "an occupied cell is in the way"
        if verdict == HIT_STATIC:
            return f"the arm would touch {self._solid_names[index]}"
        a, b = self.arm.pairs[index]
        return f"the arm would touch itself ({self._body_names[a]}, {self._body_names[b]})"
