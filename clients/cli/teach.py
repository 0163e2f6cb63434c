"""``tolman teach``: lead the arm by hand along a path, record what it does, and let the running map learn it."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from clients.cli.options import add_bus_arguments, add_cell_arguments, open_bus
from clients.demonstrations import DEMONSTRATIONS, waypoints_of
from clients.recorder import Recorder
from clients.waiting import wait_until
from common import cell
from common.bus.channels import Queue
from common.bus.session import Bus
from common.errors import ConfigError
from common.robot.model import RobotModel, load_robot
from common.robot.taught import TaughtMotion, read_taught, write_taught
from common.wire import keys
from common.wire.messages import Demonstration, Empty, Guide, GuideReply, LearnReply, RobotState, ServiceInfo
from services.planner.config import PlannerConfig

__all__ = ["add_arguments", "run"]

LEARN_TIMEOUT_S = 60.0  # our choice: a long path among many waiting ones
END_SLACK_S = 10.0  # our choice: how much later than told a guided motion may end

DESCRIPTION = f"""
In simulation a hand takes the tool where it is and drags it along --path; the arm follows by inverse kinematics (a follower, not a force),
at most at 0.25 m/s and half of its joint limits, and is driven by the executor like any trajectory: tolman stop ends it.
--record writes what the joints did. Without --path it records whatever the arm does, until Ctrl-C.
A recorded file trains a map (tolman build --motions FILE), is part of a cell (key planner.taught of its config), or is learned by the map
that runs: --learn, after a recording or of a FILE that is there.
Built-in paths for the UR3 cell: {", ".join(DEMONSTRATIONS)}.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What to lead, record and learn."""
    parser.epilog = DESCRIPTION
    parser.add_argument("--path", metavar="NAME|FILE", help="drag the tool along this: a built-in name, or JSON with a list of waypoints")
    parser.add_argument("--record", type=Path, metavar="FILE", help="write the motion there (JSON)")
    parser.add_argument("--learn", nargs="?", const="", metavar="FILE", help="let the running map learn the motion, or that of FILE")
    parser.add_argument("--label", default="", help="what the motion is called in file and map log (default: name of path or file)")
    add_cell_arguments(parser)
    add_bus_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """0: recorded, learned."""
    if args.record is None and args.learn is None and args.path is None:
        raise ConfigError("nothing to do: give --path, --record or --learn")
    if args.learn and (args.path or args.record):
        raise ConfigError(f"--learn {args.learn}: learns that file; leave FILE away to learn what is recorded now")
    waypoints = waypoints_of(args.path) if args.path is not None else []
    shared, _ = cell.load(args.config, "planner", PlannerConfig, args.set)
    robot = load_robot(shared.robot)
    with open_bus(args) as bus:
        _check_same_arm(bus, robot)
        if args.learn:
            motion = read_taught(Path(args.learn), robot)
        else:
            recorder = _lead_and_record(bus, Guide(op="start", waypoints=waypoints) if waypoints else None)
            named = args.label or (Path(args.path).stem if args.path else "") or (args.record.stem if args.record else "")
            motion = _recorded(recorder, named, robot)
            print(f"recorded {len(motion.q_rad)} samples, {motion.t_s[-1]:.2f} s" + (f": {recorder.reason}" if recorder.reason else ""))
        if args.record is not None:
            write_taught(args.record, motion, robot)
            print(f"written to {args.record}")
        if args.learn is not None:
            _learn(bus, motion, args.label)
    return 0


def _check_same_arm(bus: Bus, robot: RobotModel) -> None:
    found = bus.request(keys.info("robot"), Empty(), ServiceInfo).fingerprints.get("robot", "")
    if found != robot.fingerprint:
        raise ConfigError(f"--config: its arm {robot.name} is {robot.fingerprint}, the stack's is {found}: give the stack's config")


def _lead_and_record(bus: Bus, guide: Guide | None) -> Recorder:
    """Record a guided motion to its end, or what is there until Ctrl-C; on Ctrl-C the hand lets go."""
    states: Queue[RobotState] = bus.queue("robot/state", RobotState)
    if guide is None:
        recorder = Recorder()
        print("recording; Ctrl-C ends it", flush=True)
        _until_over(bus, states, recorder, float("inf"))
        return recorder
    reply = bus.request("robot/guide", guide, GuideReply)
    recorder = Recorder(reply.guide_id)
    print(f"the hand leads for {reply.duration_s:.1f} s ({reply.guide_id}); Ctrl-C lets go", flush=True)
    if _until_over(bus, states, recorder, reply.duration_s + END_SLACK_S):
        return recorder
    bus.request("robot/guide", Guide(op="release"), GuideReply)
    _until_over(bus, states, recorder, END_SLACK_S)
    return recorder


def _until_over(bus: Bus, states: Queue[RobotState], recorder: Recorder, timeout_s: float) -> bool:
    def is_over() -> bool:
        recorder.hear(received.message for received in states.take_all())
        return recorder.is_over

    try:
        return wait_until(bus, is_over, timeout_s)
    except KeyboardInterrupt:
        return False


def _recorded(recorder: Recorder, label: str, robot: RobotModel) -> TaughtMotion:
    motion = recorder.motion(label)
    # What is measured may lie a rounding beyond a limit that the reference keeps.
    return TaughtMotion(motion.t_s, np.clip(motion.q_rad, robot.position_min_rad, robot.position_max_rad), label)


def _learn(bus: Bus, motion: TaughtMotion, label: str) -> None:
    demonstration = Demonstration(q_rad=motion.q_rad, t_s=motion.t_s, label=label or motion.label)
    reply = bus.request("planner/learn", demonstration, LearnReply, timeout_s=LEARN_TIMEOUT_S)
    print(
        f"learned in {reply.seconds:.2f} s: {reply.added_neurons} neurons and {reply.added_edges} edges more, "
        f"{reply.n_neurons} neurons now" + (f" (entry {reply.number} of tolman map log)" if reply.added_edges else "")
    )
