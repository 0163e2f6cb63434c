"""Slow and obvious twins of what is measured and allowed by separation."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from services.planner.kernels.cells import Cells
from services.planner.kernels.collision import Arm
from services.planner.kernels.reach import Reach
from services.planner.kernels.separation import SpeedLaw
from services.planner.kernels.static_layer import Solids, solid_distance
from tests.support.slow_layers import slow_far

__all__ = ["slow_allowed_speed", "slow_body_separation", "slow_clearance"]


def slow_clearance(arm: Arm, solids: Solids, cells: Cells, frames: np.ndarray) -> float:
    """Every cover sphere against every cell's cube and, of what moves, against every solid."""
    grids, gaps = arm.grids, []
    for b, moving in enumerate(arm.moving):
        frame = frames[grids.body_joint[b]]
        groups = range(grids.group_offset[b], grids.group_offset[b + 1])
        spheres = np.concatenate([grids.spheres_m[grids.group_sphere_offset[g] : grids.group_sphere_offset[g + 1]] for g in groups])
        centres = spheres[:, :3] @ frame[:3, :3].T + frame[:3, 3]
        if len(cells.centre_m):
            beyond = np.maximum(np.abs(centres[:, None] - cells.centre_m[None]) - cells.half_m, 0.0)
            gaps.append((np.linalg.norm(beyond, axis=2) - spheres[:, None, 3]).min())
        for s in range(len(solids.kind) if moving else 0):
            far = [solid_distance(solids.kind, solids.size_m, solids.rotation, solids.translation, s, *c) for c in centres]
            gaps.append((np.array(far) - spheres[:, 3]).min())
    return max(0.0, min(gaps, default=np.inf))


def slow_body_separation(arm: Arm, reach: Reach, cells: Cells, b: int, frame: np.ndarray, enough_m: float) -> tuple[float, float]:
    """Every cell's ball against every part of the body, by the part's sphere and by the grid that reaches beyond; no block, no group.

    And the same if the sphere about the whole body counts too: the parts' spheres stick out of it a little, so it may know better.
    """
    grids, ball_m, least_m, most_m = arm.grids, cells.half_m * np.sqrt(3.0), enough_m, enough_m
    in_body = (cells.centre_m - frame[:3, 3]) @ frame[:3, :3]
    far_m = np.array([slow_far(reach, b, point) for point in in_body]) - ball_m
    to_bound_m = np.linalg.norm(in_body - grids.bound_centre_m[b], axis=1) - grids.bound_radius_m[b] - ball_m
    for part in grids.part_m[grids.part_offset[b] : grids.part_offset[b + 1]]:
        to_part_m = np.maximum(np.linalg.norm(in_body - part[:3], axis=1) - part[3] - ball_m, far_m)
        least_m = min(least_m, float(to_part_m.min()))
        most_m = min(most_m, float(np.maximum(to_part_m, to_bound_m).min()))
    return least_m, most_m


def slow_allowed_speed(law: SpeedLaw, separation_m: float) -> float:
    """ISO/TS 15066 as it is written: the speed at which S_h + S_r + S_s is the separation, found by bisection."""

    def needed(v: float) -> float:
        t_s = v / law.braking_m_s2
        s_h, s_r, s_s = law.person_m_s * (law.reaction_s + t_s), v * law.reaction_s, v * v / (2.0 * law.braking_m_s2)
        return s_h + s_r + s_s - separation_m

    return law.reduced_m_s if needed(law.reduced_m_s) >= 0.0 else float(brentq(needed, law.reduced_m_s, 100.0))
