"""The slow obvious twin of ``camera_kernels.degrade``."""

from __future__ import annotations

import numpy as np


def degrade(depth_m, normals, offset, sigma_per_m2, edge_step, edge_below, min_m, max_m):
    height, width = depth_m.shape
    out = np.zeros((height, width), dtype=np.uint16)
    i = offset
    for v in range(height):
        for u in range(width):
            i = i + 2 if i + 3 < len(normals) else 0
            z = float(depth_m[v, u])
            if not min_m <= z <= max_m:
                continue
            around = [(v, u - 1), (v, u + 1), (v - 1, u), (v + 1, u)]
            values = [float(depth_m[a, b]) for a, b in around if 0 <= a < height and 0 <= b < width]
            if any(abs(n - z) > z * edge_step for n in values) and normals[i + 1] < edge_below:
                continue
            mm = np.rint((z + sigma_per_m2 * z * z * float(normals[i])) * 1000.0)
            if 1 <= mm <= 65535:
                out[v, u] = mm
    return out
