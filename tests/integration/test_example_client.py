"""The example script, as a stranger would run it: zenoh, msgpack and numpy against the real stack."""

from __future__ import annotations

import ast
import subprocess
import sys

import pytest

from clients.stack import OwnStack
from common.bus.session import Bus
from tests.support.repository import ROOT

pytestmark = pytest.mark.integration
SCRIPT = ROOT / "clients" / "examples" / "minimal.py"


def test_it_is_short_and_needs_three_libraries_alone() -> None:
    source = SCRIPT.read_text(encoding="utf-8")
    assert len(source.splitlines()) <= 60
    imported = {alias.name for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Import) for alias in node.names}
    assert imported - set(sys.stdlib_module_names) == {"zenoh", "msgpack", "numpy"}


def test_it_adds_an_obstacle_plans_drives_and_reads_state(stack: OwnStack, bus: Bus) -> None:
    line = [sys.executable, SCRIPT, stack.address.endpoint, stack.address.namespace]
    result = subprocess.run(line, capture_output=True, text=True, check=False, timeout=120)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "plan: path" in result.stdout
    assert "goal reached: True" in result.stdout
