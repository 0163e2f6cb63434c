"""``tolman plan``: ask for a path; of a running stack, or with --offline of the map alone."""

from __future__ import annotations

import argparse

import numpy as np

from clients.cli.options import add_bus_arguments, add_cell_arguments, add_goal_arguments, goal_of, open_bus, print_json
from common.wire.messages import PlanReply, PlanRequest

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The question."""
    add_goal_arguments(parser)
    parser.add_argument("--start", type=float, nargs="+", metavar="RAD", help="joint vector (default: where the arm is; offline: home)")
    parser.add_argument("--cells", type=int, nargs="*", default=None, help="flat indices of occupied cells (default: the live ones)")
    parser.add_argument("--search", choices=["dijkstra", "wavefront", "astar", "bidirectional"])
    parser.add_argument("--rules", choices=["checked", "paper"])
    parser.add_argument("--ways", nargs="+", choices=["map", "repair", "fallback"], help="which may answer (default: those configured)")
    parser.add_argument("--no-smooth", action="store_true", help="the path through the neurons as it is")
    parser.add_argument("--refine", action="store_true", help="wait some milliseconds more for a shorter path")
    parser.add_argument("--offline", action="store_true", help="load the map and plan here, without a stack")
    parser.add_argument("--timeout", type=float, default=10.0, metavar="S", help="for the answer (default %(default)s)")
    parser.add_argument("--json", action="store_true", help="the whole reply as JSON")
    add_cell_arguments(parser)
    add_bus_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """0: there is a path; 3: the answer is that there is none."""
    request = _request(args)
    if args.offline:
        from services.planner.offline.ask import plan_offline  # noqa: PLC0415 (loads the planner: only when asked for)

        reply = plan_offline(args.config, args.set, request)
    else:
        with open_bus(args) as bus:
            reply = bus.request("planner/plan", request, PlanReply, timeout_s=args.timeout)
    print_json(reply) if args.json else print(_describe(reply))
    return 0 if reply.outcome == "path" else 3


def _request(args: argparse.Namespace) -> PlanRequest:
    return PlanRequest(
        goal=goal_of(args),
        q_start_rad=None if args.start is None else np.asarray(args.start, dtype=np.float64),
        cells=None if args.cells is None else np.asarray(args.cells, dtype=np.int32),
        search=args.search,
        rules=args.rules,
        ways=args.ways,
        smooth=False if args.no_smooth else None,
        refine=True if args.refine else None,
    )


def _describe(reply: PlanReply) -> str:
    times = ", ".join(f"{name} {ms:.2f} ms" for name, ms in reply.timing_ms.items())
    if reply.outcome != "path":
        return f"{reply.outcome}: {reply.reason}" + (f" ({times})" if times else "")
    lines = [f"path by {reply.way or 'map'}: {reply.length_rad:.3f} rad over {len(reply.neurons)} neurons"]
    if reply.trajectory is not None:
        way = ", along a shorter path than that" if reply.refined else ""
        lines.append(f"trajectory: {reply.trajectory.t_s[-1]:.2f} s, {len(reply.trajectory.t_s)} knots{way}")
    if times:
        lines.append(times)
    lines += ["  " + "  ".join(f"{value:+.3f}" for value in q) for q in reply.path_q_rad]
    return "\n".join(lines)
