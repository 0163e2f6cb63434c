"""The cell and the arm that ship with tolman, loaded once per test process."""

from __future__ import annotations

from functools import cache

from common.cell import CellConfig
from common.config import SERVICE_SECTIONS, load_tables, parse
from common.robot.model import RobotModel, load_robot


@cache
def ur3_cell() -> CellConfig:
    tables = load_tables(None)
    return parse({key: value for key, value in tables.items() if key not in SERVICE_SECTIONS}, CellConfig, place="default config")


@cache
def ur3() -> RobotModel:
    return load_robot(ur3_cell().robot)
