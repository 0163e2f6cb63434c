"""Options and output that several commands share."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from common.bus.service import add_bus_arguments
from common.bus.session import Bus, BusAddress
from common.config import config_of_robot, robots
from common.wire.messages import Message, Pose, SetGoal

__all__ = ["TOOL_DOWN_XYZW", "add_bus_arguments", "add_cell_arguments", "add_goal_arguments", "goal_of", "open_bus", "plain", "print_json"]

TOOL_DOWN_XYZW = [1.0, 0.0, 0.0, 0.0]  # half a turn about x: the tool's z points at the table
CONNECT_TIMEOUT_S = 2.0  # our choice: a person waits for this


def open_bus(args: argparse.Namespace) -> Bus:
    """The session of a command.

    Raises:
        RemoteError: no router there.
    """
    return Bus(BusAddress(args.connect, args.namespace), connect_timeout_s=CONNECT_TIMEOUT_S)


def add_cell_arguments(parser: argparse.ArgumentParser) -> None:
    """``--config`` or ``--robot``, and ``--set``."""
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--config", type=Path, default=None, metavar="FILE", help="cell config (TOML); default: the UR3 cell")
    which.add_argument(
        "--robot", type=config_of_robot, dest="config", metavar="NAME", help=f"the cell that ships for an arm: {', '.join(robots())}"
    )
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="override one config value: planner.rules=paper")


def add_goal_arguments(parser: argparse.ArgumentParser) -> None:
    """One of ``--q``, ``--pose``, ``--name``; and ``--speed-scale``."""
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument("--q", type=float, nargs="+", metavar="RAD", help="joint vector")
    where.add_argument(
        "--pose",
        type=float,
        nargs="+",
        metavar="M",
        help="tool pose: x y z (the tool points down) or x y z qx qy qz qw",
    )
    where.add_argument("--name", help="a pose of the config, for example home")
    parser.add_argument("--speed-scale", type=float, default=None, help="share of the joint speed limits, above 0 up to 1")


def goal_of(args: argparse.Namespace) -> SetGoal:
    """The goal of :func:`add_goal_arguments`.

    Raises:
        SystemExit: a pose of neither 3 nor 7 numbers.
    """
    pose = None
    if args.pose is not None:
        if len(args.pose) not in (3, 7):
            raise SystemExit(f"--pose takes 3 or 7 numbers, got {len(args.pose)}")
        pose = Pose(position_m=args.pose[:3], quaternion_xyzw=args.pose[3:] or TOOL_DOWN_XYZW)
    q_rad = None if args.q is None else np.asarray(args.q, dtype=np.float64)
    return SetGoal(q_rad=q_rad, pose=pose, name=args.name, speed_scale=args.speed_scale)


def plain(value: Any) -> Any:
    """A message (or anything made of messages) as plain data; arrays become lists."""
    if isinstance(value, Message):
        return {name: plain(getattr(value, name)) for name in value.__struct_fields__}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return msgspec.to_builtins(value)


def print_json(value: Any) -> None:
    """One line of JSON on stdout."""
    print(json.dumps(plain(value)))
