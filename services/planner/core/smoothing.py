"""NURBS through the neighbourhood of a path, from very smooth down to the path itself.

Piegl and Tiller, The NURBS Book, chapter 4: a clamped rational B-spline of degree p, its control points taken from the path, evaluated as
a B-spline in homogeneous coordinates. How smooth a curve is = how many control points are kept, how high p, how low the inner weights.
:func:`candidates` yields curves of falling smoothness; the caller takes the first whose timed curve is free.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

__all__ = ["Nurbs", "candidates"]

F64 = NDArray[np.float64]
# (share of inner points kept, degree, inner weight), from smooth to close. Our choice; ALGORITHMS "Smoothing".
LEVELS = ((0.34, 4, 1.0), (0.67, 4, 1.0), (1.0, 3, 1.0), (1.0, 3, 4.0))
BLENDS_RAD = (0.15, 0.05)  # rounding of corners in the last levels: distance from the corner at which the curve leaves the line; our choice


@dataclass(frozen=True, eq=False)
class Nurbs:
    """A rational B-spline curve over 0..1 in joint space.

    Attributes:
        spline: of homogeneous control points (weight times point, weight).
        name: which level made it, for status and statistics.
    """

    spline: BSpline
    name: str

    @staticmethod
    def of(control_rad: F64, degree: int, inner_weight: float, name: str) -> Nurbs:
        """Clamped curve with the given control points (P, J), P >= 2; the degree is lowered where there are too few points.

        Knots are spaced by the way between control points, so that uneven points do not make the parameter speed jump.
        """
        p = min(degree, len(control_rad) - 1)
        weight = np.full(len(control_rad), inner_weight)
        weight[[0, -1]] = 1.0
        chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(control_rad, axis=0), axis=1))])
        chord /= chord[-1]
        # Averaging of parameters (The NURBS Book, equation 9.8).
        inner = [float(np.mean(chord[i : i + p])) for i in range(1, len(control_rad) - p)]
        knots = np.concatenate([np.zeros(p + 1), inner, np.ones(p + 1)])
        homogeneous = np.column_stack([control_rad * weight[:, None], weight])
        return Nurbs(BSpline(knots, homogeneous, p), name)

    def __call__(self, s: F64) -> F64:
        """Points (K, J) at the parameters ``s`` (K,)."""
        h = self.spline(s)
        return np.asarray(h[:, :-1] / h[:, -1:])

    def derivatives(self, s: F64) -> tuple[F64, F64, F64]:
        """Points, first and second derivatives by the parameter, each (K, J); quotient rule (The NURBS Book, equation 4.8)."""
        h0, h1, h2 = self.spline(s), self.spline(s, nu=1), self.spline(s, nu=2)
        w0, w1, w2 = h0[:, -1:], h1[:, -1:], h2[:, -1:]
        c0 = h0[:, :-1] / w0
        c1 = (h1[:, :-1] - w1 * c0) / w0
        return c0, c1, (h2[:, :-1] - 2.0 * w1 * c1 - w2 * c0) / w0


def candidates(path_rad: F64, *, lead_in: bool) -> Iterator[Nurbs]:
    """Curves from smooth to close for a path (P, J), P >= 2.

    Args:
        path_rad: points; the curve starts at the first and ends at the last.
        lead_in: keep the first segment as it is (the arm leaves along its velocity): the second point is never thinned out.
    """
    if len(path_rad) == 2:
        yield Nurbs.of(path_rad, 1, 1.0, "straight")
        return
    first = 1 if lead_in else 0
    for share, degree, weight in LEVELS:
        inner = np.arange(first + 1, len(path_rad) - 1)
        n = int(np.ceil(share * len(inner)))
        picked = inner[np.round(np.linspace(0, len(inner) - 1, n)).astype(int)] if n else inner[:0]
        index = np.concatenate([np.arange(first + 1), picked, [len(path_rad) - 1]])
        yield Nurbs.of(path_rad[index], degree, weight, f"nurbs p={degree} keep={share:g} w={weight:g}")
    for blend in BLENDS_RAD:
        yield Nurbs.of(_blended(path_rad, blend), 2, 1.0, f"blend {blend:g} rad")


def _blended(path_rad: F64, blend_rad: float) -> F64:
    """Control points of a quadratic curve that follows the polyline and rounds each corner within ``blend_rad`` of it."""
    points = [path_rad[0]]
    for before, corner, after in zip(path_rad[:-2], path_rad[1:-1], path_rad[2:], strict=True):
        for other, order in ((before, 0), (after, 1)):
            way = other - corner
            length = float(np.linalg.norm(way))
            near = corner + way * min(blend_rad / max(length, 1e-12), 0.4)
            points += [near] if order == 0 else [corner, near]
    points.append(path_rad[-1])
    return np.array(points)
