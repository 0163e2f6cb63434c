"""Paths for the guiding hand: built-in ones for the cells that ship with tolman, and files of waypoints."""

from __future__ import annotations

from pathlib import Path

import msgspec

from common.errors import ConfigError
from common.wire.messages import Waypoint

__all__ = ["DEMONSTRATIONS", "waypoints_of"]


def _through(*positions_m: tuple[float, float, float], speed_m_s: float = 0.2) -> list[Waypoint]:
    return [Waypoint(position_m=list(position), speed_m_s=speed_m_s) for position in positions_m]


# Tool positions in the world of the UR3 cell, the tool as it is at home (pointing down). Our choice.
DEMONSTRATIONS: dict[str, list[Waypoint]] = {
    "over": _through(
        (0.32, -0.10, 0.35), (0.32, -0.30, 0.22), (0.32, -0.30, 0.35), (0.36, 0.0, 0.38), (0.32, 0.30, 0.35), (0.32, 0.30, 0.22)
    ),
    "round": _through((0.30, 0.20, 0.30), (0.12, 0.30, 0.30), (-0.08, 0.30, 0.30), (-0.20, 0.22, 0.30)),
}


def waypoints_of(name_or_file: str) -> list[Waypoint]:
    """The waypoints of a built-in demonstration, or of a JSON file: a list of ``{"position_m": [x, y, z]}`` with, if wanted,
    ``quaternion_xyzw``, ``speed_m_s`` and ``rest_s``.

    Raises:
        ConfigError: neither; names what is wrong and where.
    """
    if name_or_file in DEMONSTRATIONS:
        return DEMONSTRATIONS[name_or_file]
    try:
        content = Path(name_or_file).read_bytes()
    except OSError as error:
        known = ", ".join(DEMONSTRATIONS)
        raise ConfigError(f"--path {name_or_file}: no built-in demonstration ({known}) and no file: {error.strerror}") from None
    try:
        return msgspec.json.decode(content, type=list[Waypoint])
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"--path {name_or_file}: {error}") from None
