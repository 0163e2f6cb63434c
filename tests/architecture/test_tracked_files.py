"""What no tracked file may hold: paths of one machine, addresses of registries; and what pinned files must look like."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

from tests.support.repository import ROOT, text_files

MACHINE_PATH = re.compile(r"(?<![\w.])/(?:work|root|home/\w+|Users/\w+)/")
REGISTRY = re.compile(r"(?:py" + r"pi\.org|files\.pythonhosted|index-url|npm" + r"js\.org|deb\.debian)")


@pytest.mark.parametrize("path", text_files(), ids=lambda path: str(path.relative_to(ROOT)))
def test_no_machine_path_and_no_registry(path: Path) -> None:
    if path == Path(__file__):
        return
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        assert not MACHINE_PATH.search(line), f"{path.name}:{number}: path of one machine: {line.strip()}"
        assert not REGISTRY.search(line), f"{path.name}:{number}: address of a registry: {line.strip()}"


def test_constraints_are_plain_names_and_versions() -> None:
    lines = [line for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    assert lines
    assert [line for line in lines if not re.fullmatch(r"[A-Za-z0-9._-]+==[A-Za-z0-9._+!-]+", line)] == []


def test_every_direct_requirement_is_pinned() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = project["dependencies"] + [line for extra in project["optional-dependencies"].values() for line in extra]
    on_linux = [line for line in wanted if "!= 'linux'" not in line and not line.startswith("tolman[")]
    names = {re.split(r"[<>=;\[ ]", line)[0].lower() for line in on_linux}
    pinned = {line.partition("==")[0].lower() for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()}
    assert names <= pinned
