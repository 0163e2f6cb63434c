"""The command line itself: help, wrong words, errors in one line, quick start."""

from __future__ import annotations

import importlib
import json
import subprocess
import sys

import msgspec
import numpy as np
import pytest

from clients.cli.main import COMMANDS, main
from clients.cli.options import TOOL_DOWN_XYZW
from clients.stack import free_endpoint
from common.wire import codec
from common.wire.messages import Clearance, SetObstacle
from tests.support.repository import ROOT


def test_help_names_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 0
    text = capsys.readouterr().out
    for name, command in COMMANDS.items():
        assert f"  {name} " in text
        assert command.summary in text


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main([name, "--help"])
    assert caught.value.code == 0
    assert f"usage: tolman {name}" in capsys.readouterr().out


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_file_says_what_it_is(name: str) -> None:
    module = importlib.import_module(COMMANDS[name].module)
    assert module.__doc__ is not None
    assert "``tolman " in module.__doc__
    assert name in module.__doc__


def test_the_top_level_imports_no_library() -> None:
    program = "import sys, clients.cli.main; print([m for m in ('numpy', 'zenoh', 'msgspec', 'rich', 'scipy') if m in sys.modules])"
    result = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def test_a_wrong_word_is_one_line_with_a_hint(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["obstacel"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "did you mean obstacle?" in captured.err
    assert captured.err.count("\n") == 1


def test_no_stack_is_one_line_with_its_code(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["cancel", "--connect", free_endpoint()]) == 1
    captured = capsys.readouterr()
    assert captured.err.startswith("no_router: ")
    assert captured.err.count("\n") == 1


def test_down_without_a_stack_is_no_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["down", "--connect", free_endpoint()]) == 0
    assert "nothing runs" in capsys.readouterr().out


def test_a_config_error_names_file_and_key(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["demo", "--set", "demo.hand.sped_m_s=1", "--connect", free_endpoint()]) == 2
    assert "sped_m_s" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        (
            "add b --size 0.1 0.2 0.3 --at 0.4 0 0.2",
            SetObstacle(op="add", id="b", shape="box", size_m=[0.1, 0.2, 0.3], position_m=[0.4, 0.0, 0.2]),
        ),
        ("move b --velocity 0 0 0.1", SetObstacle(op="move", id="b", velocity_m_s=[0.0, 0.0, 0.1])),
        ("remove b", SetObstacle(op="remove", id="b")),
        ("clear", SetObstacle(op="clear")),
    ],
)
def test_obstacle_lines_become_commands(line: str, expected: SetObstacle) -> None:
    assert codec.encode(parsed_obstacle(line)) == codec.encode(expected)


def test_an_obstacle_script_has_a_waypoint_for_each_place() -> None:
    request = parsed_obstacle("script b --to 0.4 0 0.2 --to 0.9 0 0.2 --rest 1.5 --speed 0.1 --loop")
    assert request.loop
    assert request.script is not None
    assert [(w.position_m, w.speed_m_s, w.rest_s) for w in request.script] == [([0.4, 0.0, 0.2], 0.1, 1.5), ([0.9, 0.0, 0.2], 0.1, 1.5)]


def parsed_obstacle(line: str) -> SetObstacle:
    import argparse

    from clients.cli import obstacle

    parser = argparse.ArgumentParser()
    obstacle.add_arguments(parser)
    return obstacle.request_of(parser.parse_args(line.split()))


def test_a_pose_of_three_numbers_points_down() -> None:
    import argparse

    from clients.cli.options import add_goal_arguments, goal_of

    parser = argparse.ArgumentParser()
    add_goal_arguments(parser)
    goal = goal_of(parser.parse_args(["--pose", "0.3", "-0.1", "0.2"]))
    assert goal.pose is not None
    assert goal.pose.position_m == [0.3, -0.1, 0.2]
    assert goal.pose.quaternion_xyzw == TOOL_DOWN_XYZW
    with pytest.raises(SystemExit, match="3 or 7"):
        goal_of(parser.parse_args(["--pose", "0.3", "-0.1"]))


def test_messages_print_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    from clients.cli.options import print_json

    message = Clearance(min_distance_m=0.1, pair=["tool", "box"], contacts=0, contacts_caused=0, contacts_suffered=0, contact_pairs=[])
    print_json({"message": message, "array": np.arange(3), "number": np.float64(0.5)})
    out = json.loads(capsys.readouterr().out)
    assert out["message"] == msgspec.to_builtins(message)
    assert out["array"] == [0, 1, 2]
    assert out["number"] == 0.5
