"""Analytic inverse kinematics of a UR arm: the referee of the numerical one.

The usual derivation from the Denavit-Hartenberg table (Hawkins, "Analytic inverse kinematics for the Universal Robots UR-5/UR-10 arms",
2013), written for the tool flange of that table.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

# UR3 (CB series), Universal Robots, "DH parameters for calculations of kinematics and dynamics": metres
UR3_D1, UR3_A2, UR3_A3, UR3_D4, UR3_D5, UR3_D6 = 0.1519, -0.24365, -0.21325, 0.11235, 0.08535, 0.0819


def dh(theta: float, d: float, a: float, alpha: float) -> F64:
    ct, st, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    return np.array([[ct, -st * ca, st * sa, a * ct], [st, ct * ca, -ct * sa, a * st], [0, sa, ca, d], [0, 0, 0, 1]])


def forward(q: F64) -> F64:
    T = np.eye(4)
    half = np.pi / 2
    rows = [(UR3_D1, 0, half), (0, UR3_A2, 0), (0, UR3_A3, 0), (UR3_D4, 0, half), (UR3_D5, 0, -half), (UR3_D6, 0, 0)]
    for angle, (d, a, alpha) in zip(q, rows, strict=True):
        T = T @ dh(angle, d, a, alpha)
    return T


def wrap(angle: float) -> float:
    return float((angle + np.pi) % (2 * np.pi) - np.pi)


def inverse(T: F64) -> list[F64]:
    """Up to 8 joint vectors in [-pi, pi) with ``forward(q) == T``."""
    found = []
    wrist = T @ np.array([0, 0, -UR3_D6, 1])
    reach = np.hypot(wrist[0], wrist[1])
    if reach < UR3_D4:
        return []
    for shoulder in (1, -1):
        q1 = np.arctan2(wrist[1], wrist[0]) + shoulder * np.arccos(UR3_D4 / reach) + np.pi / 2
        c5 = (T[0, 3] * np.sin(q1) - T[1, 3] * np.cos(q1) - UR3_D4) / UR3_D6
        if abs(c5) > 1:
            continue
        for flip in (1, -1):
            q5 = flip * np.arccos(c5)
            s5 = np.sin(q5)
            if abs(s5) < 1e-9:
                continue
            q6 = np.arctan2((-T[0, 1] * np.sin(q1) + T[1, 1] * np.cos(q1)) / s5, (T[0, 0] * np.sin(q1) - T[1, 0] * np.cos(q1)) / s5)
            T01 = dh(q1, UR3_D1, 0, np.pi / 2)
            T46 = dh(q5, UR3_D5, 0, -np.pi / 2) @ dh(q6, UR3_D6, 0, 0)
            T14 = np.linalg.inv(T01) @ T @ np.linalg.inv(T46)
            p13 = T14 @ np.array([0, -UR3_D4, 0, 1])
            c3 = (p13[0] ** 2 + p13[1] ** 2 - UR3_A2**2 - UR3_A3**2) / (2 * UR3_A2 * UR3_A3)
            if abs(c3) > 1:
                continue
            for elbow in (1, -1):
                q3 = elbow * np.arccos(c3)
                q2 = np.arctan2(-p13[1], -p13[0]) - np.arcsin(-UR3_A3 * np.sin(q3) / np.hypot(p13[0], p13[1]))
                T34 = np.linalg.inv(dh(q2, 0, UR3_A2, 0) @ dh(q3, 0, UR3_A3, 0)) @ T14
                q4 = np.arctan2(T34[1, 0], T34[0, 0])
                q = np.array([wrap(v) for v in (q1, q2, q3, q4, q5, q6)])
                if np.allclose(forward(q), T, atol=1e-6):
                    found.append(q)
    return found
