"""The compose file is well-formed and starts the processes of the table; the router's file is one that Zenoh takes."""

from __future__ import annotations

import re
import shutil
import subprocess

import pytest
import zenoh

from deploy.processes import PROCESSES
from tests.support.repository import ROOT

COMPOSE = ROOT / "deploy" / "docker-compose.yml"


@pytest.mark.skipif(shutil.which("docker-compose") is None, reason="docker-compose is not installed")
def test_docker_compose_takes_it() -> None:
    result = subprocess.run(["docker-compose", "-f", COMPOSE, "config"], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert "eclipse/zenoh" in result.stdout


def test_it_starts_every_process_of_the_table() -> None:
    commands = re.findall(r"^    command: (.*)$", COMPOSE.read_text(encoding="utf-8"), re.MULTILINE)
    for process in PROCESSES:
        line = "tolman build" if process.is_preparation else f"python -m {process.module} --connect tcp/router:7447"
        assert line in commands, f"{process.name} is not in the compose file"


def test_zenoh_takes_the_router_file() -> None:
    config = zenoh.Config.from_file(ROOT / "deploy" / "zenoh" / "router.json5")
    assert config.get_json("mode") == '"router"'
