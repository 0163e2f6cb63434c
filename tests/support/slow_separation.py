"""Slow and obvious twins of what is measured and allowed by separation."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from services.planner.kernels.cells import Cells
from services.planner.kernels.collision import Arm
from services.planner.kernels.separation import SpeedLaw
from services.planner.kernels.static_layer import Solids, solid_distance

__all__ = ["slow_allowed_speed", "slow_clearance"]


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


def slow_allowed_speed(law: SpeedLaw, separation_m: float) -> float:
    """ISO/TS 15066 as it is written: the speed at which S_h + S_r + S_s is the separation, found by bisection."""

    def needed(v: float) -> float:
        t_s = v / law.braking_m_s2
        s_h, s_r, s_s = law.person_m_s * (law.reaction_s + t_s), v * law.reaction_s, v * v / (2.0 * law.braking_m_s2)
        return s_h + s_r + s_s - separation_m

    return law.reduced_m_s if needed(law.reduced_m_s) >= 0.0 else float(brentq(needed, law.reduced_m_s, 100.0))
