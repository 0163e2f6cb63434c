"""What README and docs show can be typed: every `tolman` line parses, every `make` target exists, every link leads somewhere."""

from __future__ import annotations

import argparse
import importlib
import re
import shlex
from pathlib import Path

import pytest

from clients.cli.main import COMMANDS
from tests.support.repository import ROOT, tracked_files

PAGES = [path for path in tracked_files() if path.suffix == ".md"]
TEXT = {page.relative_to(ROOT).as_posix(): page.read_text(encoding="utf-8") for page in PAGES}
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def lines_of_blocks(word: str) -> list[tuple[str, str]]:
    """(page, line) of every line in a code block that begins with a word."""
    blocks = [(page, match[2]) for page, text in TEXT.items() for match in BLOCK.finditer(text)]
    return [(page, line) for page, block in blocks for line in block.splitlines() if line.startswith(f"{word} ")]


TOLMAN_LINES = lines_of_blocks("tolman")
MAKE_LINES = lines_of_blocks("make")


def test_there_is_something_to_try() -> None:
    assert len(TOLMAN_LINES) >= 5
    assert len(MAKE_LINES) >= 2


@pytest.mark.parametrize(("page", "line"), TOLMAN_LINES)
def test_a_tolman_line_is_one_that_the_command_takes(page: str, line: str) -> None:
    _, name, *words = shlex.split(line, comments=True)
    assert name in COMMANDS, f"{page}: {line}"
    module = importlib.import_module(COMMANDS[name].module)
    parser = argparse.ArgumentParser(prog=name, exit_on_error=False)
    module.add_arguments(parser)
    parser.parse_args(words)


@pytest.mark.parametrize(("page", "line"), MAKE_LINES)
def test_a_make_line_names_a_target(page: str, line: str) -> None:
    targets = re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert shlex.split(line, comments=True)[1] in targets, f"{page}: {line}"


@pytest.mark.parametrize(
    ("page", "block"), [(page, match[2]) for page, text in TEXT.items() for match in BLOCK.finditer(text) if match[1] == "python"]
)
def test_a_python_block_runs(page: str, block: str) -> None:
    exec(compile(block, page, "exec"), {"__name__": "__main__"})


@pytest.mark.parametrize("page", TEXT)
def test_a_link_within_the_repository_leads_somewhere(page: str) -> None:
    for target in re.findall(r"\]\((?!\w+:)([^)#]+)", TEXT[page]):
        assert (ROOT / page).parent.joinpath(target).exists(), f"{page} links to {target}"


def test_readme_begins_with_what_a_bare_debian_needs() -> None:
    first, second, *_ = TEXT["README.md"].splitlines()
    assert "Debian" in first
    assert "python3-venv" in first
    assert "make" in first
    assert second == ""


def test_ci_runs_the_readmes_test_command() -> None:
    assert "make test" in Path(ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
    assert ("README.md", next(line for _, line in MAKE_LINES if line.startswith("make test"))) in MAKE_LINES
