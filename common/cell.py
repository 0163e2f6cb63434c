"""The robot cell: which arm, where it stands, what is bolted down, which part of space is watched. Shared by all processes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from msgspec import Meta

from common.config import SERVICE_SECTIONS, Strict, load_tables, parse
from common.errors import ConfigError

__all__ = ["CellConfig", "GridConfig", "RobotConfig", "SolidConfig", "ToolConfig", "load"]

T = TypeVar("T")
Positive = Annotated[float, Meta(gt=0)]
Cells = Annotated[int, Meta(gt=0, le=1024)]
Vector3 = tuple[float, float, float]


class SolidConfig(Strict, frozen=True):
    """A rigid shape. ``size_m``: box 3 full extents; sphere [radius]; cylinder [radius, length along its z]."""

    name: str
    shape: Literal["box", "sphere", "cylinder"]
    size_m: list[Positive]
    position_m: Vector3
    rpy_rad: Vector3 = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        expected = {"box": 3, "sphere": 1, "cylinder": 2}[self.shape]
        if len(self.size_m) != expected:
            raise ValueError(f"{self.name}: a {self.shape} has {expected} sizes, got {len(self.size_m)}")


class ToolConfig(Strict, frozen=True):
    """What is bolted to the flange: its solids, in the flange frame, and the tool centre point that pose goals mean."""

    solids: list[SolidConfig] = []
    tcp_position_m: Vector3 = (0.0, 0.0, 0.0)
    tcp_rpy_rad: Vector3 = (0.0, 0.0, 0.0)


class RobotConfig(Strict, frozen=True):
    """The arm. ``urdf``: a path, ``example-robot-data:<path below robots/>``, or
    ``tolman:<file>`` for our own descriptions. Limits given here narrow the URDF's.

    ``locked_joints``: side joints (fingers) frozen at a value, so that a serial arm remains. ``immobile_links``: stand in the static
    layer and are not checked against it. ``voxel_m``: edge of the voxels in which the distances to the arm's bodies are kept; they are
    rounded down by up to its diagonal.
    """

    name: str
    urdf: str
    flange_frame: str
    home_rad: list[float]
    max_acceleration_rad_s2: list[Positive]
    position_min_rad: list[float] | None = None
    position_max_rad: list[float] | None = None
    max_velocity_rad_s: list[Positive] | None = None
    base_position_m: Vector3 = (0.0, 0.0, 0.0)
    base_rpy_rad: Vector3 = (0.0, 0.0, 0.0)
    immobile_links: list[str] = []
    locked_joints: dict[str, float] = {}
    tool: ToolConfig = ToolConfig()
    # Our choice: rounding stays below a quarter of a 2 cm cell, the grids of an arm below 3 MB.
    voxel_m: Annotated[float, Meta(ge=0.001, le=0.01)] = 0.005


class GridConfig(Strict, frozen=True):
    """The watched part of space, in cubic cells; world frame."""

    origin_m: Vector3
    shape: tuple[Cells, Cells, Cells]
    resolution_m: Annotated[float, Meta(gt=0, le=0.2)]


class CellConfig(Strict, frozen=True):
    """All shared sections of a cell config file."""

    robot: RobotConfig
    grid: GridConfig
    table_z_m: float
    static: list[SolidConfig] = []
    poses: dict[str, list[float]] = {}


def load(path: Path | None, section: str, kind: type[T], overrides: list[str] | None = None) -> tuple[CellConfig, T]:
    """The shared part of a config file and one service's own section.

    Args:
        path: TOML file, None for the UR3 cell.
        section: the caller's section, one of :data:`common.config.SERVICE_SECTIONS`.
        kind: its type; a missing section means all defaults.
        overrides: ``--set`` strings.

    Raises:
        ConfigError: names file, section and key.
    """
    place = str(path) if path is not None else "default config"
    tables: dict[str, Any] = load_tables(path, overrides)
    shared = {key: value for key, value in tables.items() if key not in SERVICE_SECTIONS}
    cell = parse(shared, CellConfig, place=place)
    _check_joint_counts(cell, place)
    return cell, parse(tables.get(section, {}), kind, place=f"{place} [{section}]")


def _check_joint_counts(cell: CellConfig, place: str) -> None:
    n_joints = len(cell.robot.home_rad)
    for name in ("max_acceleration_rad_s2", "position_min_rad", "position_max_rad", "max_velocity_rad_s"):
        values = getattr(cell.robot, name)
        if values is not None and len(values) != n_joints:
            raise ConfigError(f"{place}: robot.{name} has {len(values)} values, robot.home_rad has {n_joints}")
    for name, q in cell.poses.items():
        if len(q) != n_joints:
            raise ConfigError(f"{place}: poses.{name} has {len(q)} values, robot.home_rad has {n_joints}")
