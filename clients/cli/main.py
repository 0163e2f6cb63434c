"""``tolman``: one command, one file. Only the chosen command's module is imported, so that help comes at once.

A command module has ``add_arguments(parser)`` and ``run(args) -> int``; its first docstring line is its help.
"""

from __future__ import annotations

import argparse
import difflib
import importlib
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass

from common.errors import ConfigError, TolmanError
from common.version import VERSION

__all__ = ["COMMANDS", "main"]


@dataclass(frozen=True)
class Command:
    """A row of the command table: where it lives and what it does in a few words."""

    module: str
    summary: str


COMMANDS: dict[str, Command] = {
    "demo": Command("clients.cli.demo", "the whole loop at work, with a hand and boxes in the way"),
    "up": Command("clients.cli.up", "start the whole stack"),
    "down": Command("clients.cli.down", "stop a stack"),
    "status": Command("clients.cli.status", "live table of rates, ages, latencies and states"),
    "watch": Command("clients.cli.watch", "print events and changes of state as they come"),
    "goal": Command("clients.cli.goal", "send the arm to a joint vector, a tool pose or a named pose"),
    "cancel": Command("clients.cli.cancel", "give up the goal"),
    "plan": Command("clients.cli.plan", "ask for a path without moving anything"),
    "obstacle": Command("clients.cli.obstacle", "add, move, script or remove obstacles"),
    "stop": Command("clients.cli.robot", "protective stop of the arm"),
    "resume": Command("clients.cli.robot", "end a protective stop"),
    "reset": Command("clients.cli.robot", "arm to its home pose, contact and distance counts to zero"),
    "grasp": Command("clients.cli.grasp", "tell the arm that its gripper holds a box from now on, or nothing"),
    "teach": Command("clients.cli.teach", "lead the arm by hand, record it, let the map learn it"),
    "map": Command("clients.cli.map", "what the map has learned since it was built, and undoing it"),
    "build": Command("clients.cli.build", "make the cognitive map and its table"),
    "bench": Command("clients.cli.bench", "measure the figures of README"),
    "paper": Command("clients.cli.paper", "repeat the paper's experiments: tables, figures and claims beside ours"),
    "doctor": Command("clients.cli.doctor", "say what is missing on this machine, and the line that mends it"),
}


def _overview() -> str:
    lines = ["usage: tolman COMMAND [options]", "", "A reflex for robot arms: reactive path planning in a learned cognitive map.", ""]
    lines += [f"  {name:<10}{command.summary}" for name, command in COMMANDS.items()]
    return "\n".join([*lines, "", "tolman COMMAND --help says more; tolman --version prints the version."])


def _unknown(name: str) -> str:
    near = difflib.get_close_matches(name, COMMANDS, n=1)
    hint = f"; did you mean {near[0]}?" if near else ""
    return f"unknown_command: {name!r} is not a command of tolman{hint} (tolman --help lists them)"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; an error is one line on stderr with its code, and a non-zero exit."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if not words or words[0] in ("-h", "--help", "help"):
        print(_overview())
        return 0
    if words[0] == "--version":
        print(VERSION)
        return 0
    name = words[0]
    if name not in COMMANDS:
        print(_unknown(name), file=sys.stderr)
        return 2
    module = importlib.import_module(COMMANDS[name].module)
    parser = argparse.ArgumentParser(prog=f"tolman {name}", description=COMMANDS[name].summary)
    parser.set_defaults(command=name)
    module.add_arguments(parser)
    try:
        return int(module.run(parser.parse_args(words[1:])))
    except TolmanError as error:
        print(f"{error.code}: {error.message}", file=sys.stderr)
        return 2 if isinstance(error, ConfigError) else 1
    except BrokenPipeError:  # the reader (head, less) has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except KeyboardInterrupt:
        return 130  # the shell's convention for "ended by Ctrl-C"


if __name__ == "__main__":
    sys.exit(main())
