"""Numba kernel of the self-filter: which points are the arm, by the shared distance grids. Twin: ``tests/support/slow_perception.py``."""

from __future__ import annotations

from common.kernel import leaf
from common.robot.kernels import body_grid, look_up
from services.perception.core.arm import LARGEST_DISTANCE_M

__all__ = ["arm_mask"]


@leaf
def arm_mask(bodies, grids, points_m, n_points, mask):  # type: ignore[no-untyped-def]
    """``mask[i]`` = 1 where a point is the arm: nearer to a body than its margin + the point's own bound, as far as the grids reach.

    Args:
        bodies: (B, 17) of :class:`services.perception.core.arm.ArmState`.
        grids: the bodies' distance grids.
        points_m: (N, 4) x, y, z in the world, and the bound in metres.
        n_points: how many of them.
        mask: (N,) u1 out.
    """
    mask[:n_points] = 0
    distance = grids.distance
    for b in range(len(bodies)):
        grid = body_grid(grids, b)
        cx, cy, cz, radius, margin = bodies[b, 0], bodies[b, 1], bodies[b, 2], bodies[b, 3], bodies[b, 4]
        for i in range(n_points):
            within = min(margin + points_m[i, 3], LARGEST_DISTANCE_M)
            dx, dy, dz = points_m[i, 0] - cx, points_m[i, 1] - cy, points_m[i, 2] - cz
            limit = radius + within
            if mask[i] or dx * dx + dy * dy + dz * dz > limit * limit:
                continue
            dx, dy, dz = points_m[i, 0] - bodies[b, 14], points_m[i, 1] - bodies[b, 15], points_m[i, 2] - bodies[b, 16]
            px = bodies[b, 5] * dx + bodies[b, 8] * dy + bodies[b, 11] * dz
            py = bodies[b, 6] * dx + bodies[b, 9] * dy + bodies[b, 12] * dz
            pz = bodies[b, 7] * dx + bodies[b, 10] * dy + bodies[b, 13] * dz
            if look_up(distance, grid, px, py, pz) < within:
                mask[i] = 1
