from __future__ import annotations

import numpy as np
import pytest

from services.planner.core.smoothing import Nurbs, candidates

PATH = np.cumsum(np.random.default_rng(0).normal(scale=0.2, size=(15, 6)), axis=0)


def test_it_is_a_nurbs():
    """Against the definition: basis functions by Cox and de Boor, weights, quotient (The NURBS Book, equation 4.1)."""
    curve = Nurbs.of(PATH, 3, 4.0, "x")
    knots, p = curve.spline.t, curve.spline.k

    def basis(i, degree, u):
        if degree == 0:
            return 1.0 if knots[i] <= u < knots[i + 1] else 0.0
        left = 0.0 if knots[i + degree] == knots[i] else (u - knots[i]) / (knots[i + degree] - knots[i]) * basis(i, degree - 1, u)
        width = knots[i + degree + 1] - knots[i + 1]
        return left + (0.0 if width == 0 else (knots[i + degree + 1] - u) / width * basis(i + 1, degree - 1, u))

    weight = np.array([1.0] + [4.0] * 13 + [1.0])
    for u in (0.0, 0.21, 0.5, 0.93):
        n = np.array([basis(i, p, u) for i in range(len(PATH))])
        assert curve(np.array([u]))[0] == pytest.approx((n * weight) @ PATH / (n @ weight))


def test_derivatives_are_those_of_the_curve():
    curve = Nurbs.of(PATH, 4, 2.0, "x")
    s, h = np.linspace(0.01, 0.99, 37), 1e-5
    _, d1, d2 = curve.derivatives(s)
    np.testing.assert_allclose(d1, (curve(s + h) - curve(s - h)) / (2 * h), atol=1e-5)
    np.testing.assert_allclose(d2, (curve(s + h) - 2 * curve(s) + curve(s - h)) / h**2, rtol=1e-3, atol=1e-2)


@pytest.mark.parametrize("n", [2, 3, 4, 15])
def test_every_candidate_keeps_the_ends(n):
    for curve in candidates(PATH[:n], lead_in=False):
        ends = curve(np.array([0.0, 1.0]))
        assert ends[0] == pytest.approx(PATH[0]) and ends[1] == pytest.approx(PATH[n - 1])


def test_a_lead_in_leaves_along_the_first_segment():
    for curve in candidates(PATH, lead_in=True):
        tangent = curve.derivatives(np.zeros(1))[1][0]
        first = PATH[1] - PATH[0]
        assert tangent @ first == pytest.approx(np.linalg.norm(tangent) * np.linalg.norm(first))


def test_smoothness_is_lowered_step_by_step_down_to_the_path():
    def farthest(curve):
        points = curve(np.linspace(0, 1, 2000))
        return np.linalg.norm(PATH[:, None] - points[None], axis=2).min(axis=1).max()

    gaps = [farthest(curve) for curve in candidates(PATH, lead_in=False)]
    assert gaps[-1] < 0.06 < gaps[0]
    assert gaps[-1] == min(gaps)
