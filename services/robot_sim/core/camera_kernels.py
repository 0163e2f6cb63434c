"""Numba kernels of the cameras: exact ray casting of simple solids, rays into a link's frame, the sensor's faults.

Twins that a test compares with: Open3D's one full scene (``tests/support/full_scene.py``) and numpy (``tests/support/slow_sensor.py``).
"""

from __future__ import annotations

import math

import numpy as np

from common.kernel import leaf

__all__ = ["BOX", "CAPSULE", "CYLINDER", "SPHERE", "box_of_corners", "cast_shape", "degrade", "fill_rays", "keep_nearer"]

BOX, SPHERE, CYLINDER, CAPSULE = 0, 1, 2, 3
PARALLEL = 1e-12  # a direction component below this never reaches the plane


@leaf
def _first_positive(near, far):  # type: ignore[no-untyped-def]
    if near > 0.0:
        return near
    return far if far > 0.0 else math.inf


@leaf
def _slab(o, d, half):  # type: ignore[no-untyped-def]
    """Interval of the ray's parameter in which ``|o + t d| <= half`` along one axis (empty: near > far)."""
    if abs(d) < PARALLEL:
        return (-math.inf, math.inf) if abs(o) <= half else (math.inf, -math.inf)
    a, b = (-half - o) / d, (half - o) / d
    return (a, b) if a < b else (b, a)


@leaf
def _box(size, ox, oy, oz, dx, dy, dz):  # type: ignore[no-untyped-def]
    ax, bx = _slab(ox, dx, size[0] * 0.5)
    ay, by = _slab(oy, dy, size[1] * 0.5)
    az, bz = _slab(oz, dz, size[2] * 0.5)
    near, far = max(ax, ay, az), min(bx, by, bz)
    return _first_positive(near, far) if near <= far else math.inf


@leaf
def _sphere(radius, ox, oy, oz, dx, dy, dz):  # type: ignore[no-untyped-def]
    a, b = dx * dx + dy * dy + dz * dz, ox * dx + oy * dy + oz * dz
    c = ox * ox + oy * oy + oz * oz - radius * radius
    discriminant = b * b - a * c
    if discriminant < 0.0:
        return math.inf
    root = math.sqrt(discriminant)
    return _first_positive((-b - root) / a, (-b + root) / a)


@leaf
def _cylinder(radius, half, ox, oy, oz, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Solid cylinder |z| <= half: the round side and the slab between its caps, intersected as intervals."""
    a, c = dx * dx + dy * dy, ox * ox + oy * oy - radius * radius
    if a < PARALLEL:
        if c > 0.0:
            return math.inf
        near, far = -math.inf, math.inf
    else:
        b = ox * dx + oy * dy
        discriminant = b * b - a * c
        if discriminant < 0.0:
            return math.inf
        root = math.sqrt(discriminant)
        near, far = (-b - root) / a, (-b + root) / a
    low, high = _slab(oz, dz, half)
    near, far = max(near, low), min(far, high)
    return _first_positive(near, far) if near <= far else math.inf


@leaf
def _hit(kind, size, ox, oy, oz, dx, dy, dz):  # type: ignore[no-untyped-def]
    if kind == BOX:
        return _box(size, ox, oy, oz, dx, dy, dz)
    if kind == SPHERE:
        return _sphere(size[0], ox, oy, oz, dx, dy, dz)
    half = size[1] * 0.5
    t = _cylinder(size[0], half, ox, oy, oz, dx, dy, dz)
    if kind == CAPSULE:
        t = min(t, _sphere(size[0], ox, oy, oz - half, dx, dy, dz), _sphere(size[0], ox, oy, oz + half, dx, dy, dz))
    return t


@leaf
def cast_shape(kind, size, rotation, origin, directions, row0, row1, column0, column1, depth_m):  # type: ignore[no-untyped-def]
    """Lower ``depth_m`` (H, W) f4 to the first positive hit of the rays in the pixel box with one solid.

    Args:
        kind: BOX, SPHERE, CYLINDER or CAPSULE.
        size: (3,) metres, as in :class:`services.robot_sim.core.camera_shapes.PlacedShape`, zero-filled.
        rotation: (3, 3) camera frame into the solid's frame.
        origin: (3,) the camera's place in the solid's frame.
        directions: (H, W, 3) f4 with z = 1.
        row0, row1, column0, column1: pixel box, ends excluded.
        depth_m: in and out.
    """
    for v in range(row0, row1):
        for u in range(column0, column1):
            x, y, z = directions[v, u, 0], directions[v, u, 1], directions[v, u, 2]
            dx = rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z
            dy = rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z
            dz = rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z
            t = _hit(kind, size, origin[0], origin[1], origin[2], dx, dy, dz)
            depth_m[v, u] = min(depth_m[v, u], t)


@leaf
def box_of_corners(rotation, translation, fx, fy, cx, cy, near_m, width, height, corners_m):  # type: ignore[no-untyped-def]
    """Pixel box (row0, row1, column0, column1), ends excluded, of the hull of world points (C, 3); empty when all are behind the camera.

    ``rotation`` (3, 3), ``translation`` (3,): world into the camera's frame. Corners both before and behind ``near_m``: the whole image.
    """
    u0, u1, v0, v1 = math.inf, -math.inf, math.inf, -math.inf
    n_before = 0
    for i in range(len(corners_m)):
        a, b, c = corners_m[i, 0], corners_m[i, 1], corners_m[i, 2]
        z = rotation[2, 0] * a + rotation[2, 1] * b + rotation[2, 2] * c + translation[2]
        if z < near_m:
            continue
        n_before += 1
        u = (rotation[0, 0] * a + rotation[0, 1] * b + rotation[0, 2] * c + translation[0]) / z * fx + cx
        v = (rotation[1, 0] * a + rotation[1, 1] * b + rotation[1, 2] * c + translation[1]) / z * fy + cy
        u0, u1, v0, v1 = min(u0, u), max(u1, u), min(v0, v), max(v1, v)
    if n_before == 0:
        return 0, 0, 0, 0
    if n_before < len(corners_m):
        return 0, height, 0, width
    row0, row1 = max(0.0, math.floor(v0)), min(float(height), math.ceil(v1) + 1.0)
    column0, column1 = max(0.0, math.floor(u0)), min(float(width), math.ceil(u1) + 1.0)
    if row0 >= row1 or column0 >= column1:
        return 0, 0, 0, 0
    return int(row0), int(row1), int(column0), int(column1)


@leaf
def fill_rays(rotation, origin, directions, row0, row1, column0, column1, rays, start):  # type: ignore[no-untyped-def]
    """Write the rays of a pixel box, moved into another frame, to ``rays[start:]`` (N, 6) f4; returns the index after the last."""
    for v in range(row0, row1):
        for u in range(column0, column1):
            x, y, z = directions[v, u, 0], directions[v, u, 1], directions[v, u, 2]
            for k in range(3):
                rays[start, k] = origin[k]
                rays[start, 3 + k] = rotation[k, 0] * x + rotation[k, 1] * y + rotation[k, 2] * z
            start += 1
    return start


@leaf
def keep_nearer(t_hit, start, row0, row1, column0, column1, depth_m):  # type: ignore[no-untyped-def]
    """Lower ``depth_m`` (H, W) f4 to ``t_hit[start:]`` over a pixel box; returns the index after the last."""
    for v in range(row0, row1):
        for u in range(column0, column1):
            depth_m[v, u] = min(depth_m[v, u], t_hit[start])
            start += 1
    return start


@leaf
def degrade(depth_m, normals, offset, sigma_per_m2, edge_step, edge_below, min_m, max_m, depth_mm):  # type: ignore[no-untyped-def]
    """True depth into what the sensor says, ``depth_mm`` (H, W) u2, 0 = no return.

    Args:
        depth_m: (H, W) f4, inf where nothing is hit.
        normals: (N,) f4 standard normal numbers, N >= 2 H W; read from ``offset`` on, around the end.
        sigma_per_m2: sigma(z) = sigma_per_m2 * z^2.
        edge_step: a pixel whose depth jumps against one of its four neighbours by more than this share of itself is an edge.
        edge_below: an edge gives no return where its normal number is below this quantile.
        min_m, max_m: range of the sensor; what is nearer or farther gives no return.
        depth_mm: out.
    """
    height, width = depth_m.shape
    n = len(normals)
    i = offset
    for v in range(height):
        for u in range(width):
            z = depth_m[v, u]
            i = i + 2 if i + 3 < n else 0
            depth_mm[v, u] = 0
            if not (min_m <= z <= max_m):
                continue
            step = z * edge_step
            edge = (
                (u > 0 and abs(depth_m[v, u - 1] - z) > step)
                or (u + 1 < width and abs(depth_m[v, u + 1] - z) > step)
                or (v > 0 and abs(depth_m[v - 1, u] - z) > step)
                or (v + 1 < height and abs(depth_m[v + 1, u] - z) > step)
            )
            if edge and normals[i + 1] < edge_below:
                continue
            millimetres = np.rint((z + sigma_per_m2 * z * z * normals[i]) * 1000.0)
            if 1.0 <= millimetres <= 65535.0:
                depth_mm[v, u] = np.uint16(millimetres)
