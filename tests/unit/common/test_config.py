"""Config files that extend one another, and the shipped ones by the name of their arm."""

from __future__ import annotations

from pathlib import Path

import pytest

from clients.cli.main import main
from common.config import config_of_robot, load_tables, robots
from common.errors import ConfigError


def _write(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_sections_are_merged_key_by_key_and_lists_as_a_whole(tmp_path: Path) -> None:
    _write(tmp_path, "base.toml", "z = 1\n[a]\nx = 1\nlist = [1, 2]\n[a.deep]\nkept = true\nover = false\n")
    _write(tmp_path, "middle.toml", 'extends = "base.toml"\n[a]\nx = 2\nlist = [3]\n')
    top = _write(tmp_path, "top.toml", 'extends = "middle.toml"\n[a.deep]\nover = true\n')
    assert load_tables(top, ["a.x=5"]) == {"z": 1, "a": {"x": 5, "list": [3], "deep": {"kept": True, "over": True}}}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('extends = "nowhere.toml"', "nowhere.toml: cannot be read"),
        ("extends = 3", "expected the name of a file, got 3"),
        ('extends = "me.toml"', "does one extend itself"),
    ],
)
def test_a_wrong_extension_is_named(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        load_tables(_write(tmp_path, "me.toml", text))


@pytest.mark.parametrize("name", robots())
def test_every_shipped_cell_is_of_the_arm_that_it_is_called_after(name: str) -> None:
    assert load_tables(config_of_robot(name))["robot"]["name"] == name


def test_an_unknown_arm_is_an_error_that_lists_the_known_ones(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["build", "--robot", "ur33"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("unknown_robot: --robot ur33: no such arm") and all(name in error for name in robots())
