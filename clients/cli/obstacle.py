"""``tolman obstacle``: add, move, script or remove obstacles of the simulated scene."""

from __future__ import annotations

import argparse

from clients.cli.options import add_bus_arguments, open_bus
from common.wire.messages import Ack, SetObstacle, Waypoint

__all__ = ["add_arguments", "run"]

SIZES = "box: 3 full extents; sphere: radius; cylinder, capsule: radius and length"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """One operation each."""
    operations = parser.add_subparsers(dest="operation", required=True, metavar="OPERATION")
    add = operations.add_parser("add", help="a new body")
    add.add_argument("id")
    add.add_argument("--shape", choices=["box", "sphere", "cylinder", "capsule", "mesh"], default="box")
    add.add_argument("--size", type=float, nargs="+", metavar="M", default=[0.1, 0.1, 0.1], help=SIZES + " (default: a box of 10 cm)")
    add.add_argument("--mesh", help="name of the mesh, for shape mesh")
    _add_place(add, is_required=True)
    move = operations.add_parser("move", help="put it elsewhere, or give it a velocity")
    move.add_argument("id")
    _add_place(move, is_required=False)
    move.add_argument("--velocity", type=float, nargs=3, metavar="M/S", help="vx vy vz")
    script = operations.add_parser("script", help="let it go from place to place")
    script.add_argument("id")
    script.add_argument("--to", type=float, nargs=3, action="append", required=True, metavar="M", help="x y z; once for each waypoint")
    script.add_argument("--speed", type=float, default=0.25, metavar="M/S", help="(default %(default)s)")
    script.add_argument("--rest", type=float, default=0.0, metavar="S", help="pause at each waypoint (default %(default)s)")
    script.add_argument("--loop", action="store_true", help="begin again at the end")
    remove = operations.add_parser("remove", help="take it away")
    remove.add_argument("id")
    clear = operations.add_parser("clear", help="take all away")
    for operation in (add, move, script, remove, clear):
        add_bus_arguments(operation)


def _add_place(parser: argparse.ArgumentParser, *, is_required: bool) -> None:
    parser.add_argument("--at", type=float, nargs=3, required=is_required, metavar="M", help="x y z of its centre, world frame")
    parser.add_argument("--quaternion", type=float, nargs=4, metavar="Q", help="x y z w")


def request_of(args: argparse.Namespace) -> SetObstacle:
    """The command of a parsed line."""
    given = vars(args)
    script = None
    if args.operation == "script":
        script = [Waypoint(position_m=place, speed_m_s=args.speed, rest_s=args.rest) for place in args.to]
    return SetObstacle(
        op=args.operation,
        id=given.get("id", ""),
        shape=given.get("shape"),
        size_m=given.get("size"),
        position_m=given.get("at"),
        quaternion_xyzw=given.get("quaternion"),
        velocity_m_s=given.get("velocity"),
        mesh=given.get("mesh"),
        script=script,
        loop=given.get("loop", False),
    )


def run(args: argparse.Namespace) -> int:
    """Send the command and wait for its acknowledgement."""
    with open_bus(args) as bus:
        bus.request("robot/obstacle", request_of(args), Ack)
    print(f"{args.operation} {vars(args).get('id', '')}".strip() + ": done")
    return 0
