"""Forward kinematics from the makers' published tables: the referee of the arms that ship."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["UR_TABLES", "panda_flange", "ur_flange"]

F64 = NDArray[np.float64]

# d1, a2, a3, d4, d5, d6 in metres; Universal Robots, "DH parameters for calculations of kinematics and dynamics"
UR_TABLES = {
    "ur3": (0.1519, -0.24365, -0.21325, 0.11235, 0.08535, 0.0819),
    "ur5": (0.089159, -0.425, -0.39225, 0.10915, 0.09465, 0.0823),
    "ur10": (0.1273, -0.612, -0.5723, 0.163941, 0.1157, 0.0922),
    "ur3e": (0.15185, -0.24355, -0.2132, 0.13105, 0.08535, 0.0921),
}


def _turn_z(angle: float, d: float) -> F64:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, d], [0, 0, 0, 1]])


def _turn_x(angle: float, a: float) -> F64:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0, a], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1]])


def ur_flange(name: str, q: F64) -> F64:
    """(4, 4) of the flange in ``base_link``, which is turned by half a turn against the table's base."""
    d1, a2, a3, d4, d5, d6 = UR_TABLES[name]
    half = np.pi / 2
    T = np.diag([-1.0, -1.0, 1.0, 1.0])
    for angle, d, a, alpha in zip(q, (d1, 0, 0, d4, d5, d6), (0, a2, a3, 0, 0, 0), (half, 0, 0, half, -half, 0), strict=True):
        T = T @ _turn_z(angle, d) @ _turn_x(alpha, a)
    return T


def panda_flange(q: F64) -> F64:
    """(4, 4) of the flange; Franka Control Interface documentation, Denavit-Hartenberg parameters (Craig's convention)."""
    half = np.pi / 2
    rows = [(0, 0, 0.333), (0, -half, 0), (0, half, 0.316), (0.0825, half, 0), (-0.0825, -half, 0.384), (0, half, 0), (0.088, half, 0)]
    T = np.eye(4)
    for angle, (a, alpha, d) in zip(q, rows, strict=True):
        T = T @ _turn_x(alpha, a) @ _turn_z(angle, d)
    return T @ _turn_z(0.0, 0.107)
