"""The import law of pyproject.toml, and who may read the ground truth."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.repository import ROOT, tracked_files

# The key and every key expression that would catch it.
GROUND_TRUTH = re.compile(r"""robot/scene|["']robot/\*|["']\*\*""")


def names_of_messages(source: str) -> set[str]:
    """What a module takes from the wire's messages, by import or by attribute."""
    nodes = list(ast.walk(ast.parse(source)))
    imported = [n for node in nodes if isinstance(node, ast.ImportFrom) and node.module == "common.wire.messages" for n in node.names]
    return {alias.name for alias in imported} | {node.attr for node in nodes if isinstance(node, ast.Attribute)}


def test_import_linter_keeps_every_contract() -> None:
    linter = Path(sys.executable).parent / "lint-imports"
    result = subprocess.run([linter, "--no-cache"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.parametrize("service", ["perception", "planner"])
def test_the_service_never_names_the_ground_truth(service: str) -> None:
    sources = [path for path in tracked_files() if path.suffix == ".py" and (ROOT / "services" / service) in path.parents]
    assert sources, f"no source of {service} found: this test would prove nothing"
    for path in sources:
        text = path.read_text(encoding="utf-8")
        assert not names_of_messages(text) & {"Scene", "*"}, f"{path.relative_to(ROOT)} takes the message Scene"
        found = GROUND_TRUTH.search(text)
        assert found is None, f"{path.relative_to(ROOT)} names {found[0] if found else ''}"
