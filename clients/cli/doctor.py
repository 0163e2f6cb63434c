"""``tolman doctor``: what is missing on this machine, and the line that mends it. Needs nothing but Python itself to run."""

from __future__ import annotations

import argparse
import ctypes
import importlib.metadata
import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import deploy

__all__ = ["CHECKS", "Finding", "add_arguments", "run"]

TESTED_PYTHON = (3, 11)  # what CI runs
CORES_WANTED = 2
DISTRIBUTIONS = {  # alternatives are parted by |
    "msgspec": "the wire",
    "eclipse-zenoh": "the bus",
    "numpy": "arrays",
    "scipy": "geometry",
    "rich": "tables in the terminal",
    "pin": "the robot model",
    "libigl": "distances to meshes",
    "example-robot-data": "the UR3's description",
    "numba": "kernels",
    "toppra": "timing of paths",
    "open3d-cpu|open3d": "cameras and perception",
    "pybullet": "the simulated world",
    "matplotlib": "the demo's picture",
    "ompl": "the planners that benchmarks compare with",
}
FRAIL_MODULES = ("open3d", "pybullet", "pinocchio", "zenoh")  # compiled: installed does not mean that they load


@dataclass(frozen=True)
class Finding:
    """One thing looked at: ``mend`` is the line to run when it is not ok."""

    name: str
    is_ok: bool
    detail: str
    mend: str = ""


def python_version() -> list[Finding]:
    """The interpreter."""
    here = sys.version_info[:2]
    detail = f"{here[0]}.{here[1]}, tested is {TESTED_PYTHON[0]}.{TESTED_PYTHON[1]}"
    return [Finding("python", here >= TESTED_PYTHON, detail, "apt-get install -y python3.11 python3.11-venv && make setup")]


def python_packages() -> list[Finding]:
    """What the processes import."""
    missing = [names for names in DISTRIBUTIONS if not any(_is_installed(name) for name in names.split("|"))]
    findings = [
        Finding(f"package {names.partition('|')[0]}", False, f"needed for {DISTRIBUTIONS[names]}", "make setup") for names in missing
    ]
    return findings or [Finding("python packages", True, f"all {len(DISTRIBUTIONS)} are installed")]


def _is_installed(distribution: str) -> bool:
    try:
        importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return False
    return True


def system_libraries() -> list[Finding]:
    """The shared libraries that the wheels load."""
    findings = []
    for package, library in _system_packages():
        try:
            ctypes.CDLL(library)
        except OSError as error:
            findings.append(Finding(f"library {library}", False, str(error), f"apt-get update && apt-get install -y {package}"))
    return findings or [Finding("system libraries", True, "all found")]


def _system_packages() -> list[tuple[str, str]]:
    text = (Path(deploy.__path__[0]) / "system-packages.txt").read_text(encoding="utf-8")
    rows = [line.split() for line in text.splitlines() if line and not line.startswith("#")]
    return [(package, library) for package, library in rows if library != "-"]


def cores() -> list[Finding]:
    """Five processes want two cores at least."""
    n = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return [
        Finding(
            "cores", n >= CORES_WANTED, f"{n} usable, {CORES_WANTED} wanted", "give the machine or container more cores (taskset, cpus)"
        )
    ]


def bus_port() -> list[Finding]:
    """The router's port: free, or held by a stack of ours."""
    try:
        from clients.stack import is_free  # noqa: PLC0415 (must run where packages are missing)
        from common.bus.session import DEFAULT_ENDPOINT, BusAddress  # noqa: PLC0415
        from deploy.rundir import RunDirectory  # noqa: PLC0415
    except ImportError:
        return []
    if is_free(DEFAULT_ENDPOINT):
        return [Finding("bus port", True, f"{DEFAULT_ENDPOINT} is free")]
    pid = RunDirectory(BusAddress()).running_pid()
    if pid is not None:
        return [Finding("bus port", True, f"{DEFAULT_ENDPOINT} is in use by a running stack (pid {pid})")]
    return [Finding("bus port", False, f"{DEFAULT_ENDPOINT} is taken", "tolman up --connect tcp/127.0.0.1:17447")]


def compiled_modules() -> list[Finding]:
    """Whether the compiled packages load, each in a process of its own: some end it when they cannot."""
    findings = []
    for module in FRAIL_MODULES:
        result = subprocess.run([sys.executable, "-c", f"import {module}"], capture_output=True, text=True, check=False)
        if result.returncode != 0:
            last_words = (result.stderr.strip().splitlines() or [f"exit code {result.returncode}"])[-1]
            findings.append(Finding(f"import {module}", False, last_words, "deploy/system-packages.sh && make setup"))
    return findings or [Finding("compiled modules", True, f"{', '.join(FRAIL_MODULES)} load")]


def cognitive_map() -> list[Finding]:
    """Whether the map of the shipped cell is there; without it a first start takes minutes."""
    try:
        from common import cell  # noqa: PLC0415 (must run where packages are missing)
        from services.planner.config import PlannerConfig  # noqa: PLC0415
        from services.planner.offline.build import Job  # noqa: PLC0415
    except ImportError:
        return []
    path = Job.of(*cell.load(None, "planner", PlannerConfig)).path
    if path.exists():
        return [Finding("map", True, str(path))]
    return [Finding("map", True, "not made yet: the first start makes it, which takes minutes, or tolman build does")]


CHECKS: tuple[Callable[[], list[Finding]], ...] = (
    python_version,
    python_packages,
    system_libraries,
    compiled_modules,
    cores,
    bus_port,
    cognitive_map,
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """As a table or as JSON."""
    parser.add_argument("--json", action="store_true")


def run(args: argparse.Namespace) -> int:
    """0: nothing is missing; 1: something is."""
    findings = [finding for check in CHECKS for finding in check()]
    if args.json:
        print(json.dumps([asdict(finding) for finding in findings]))
    else:
        for finding in findings:
            print(f"{'ok     ' if finding.is_ok else 'MISSING'}  {finding.name}: {finding.detail}")
            if not finding.is_ok:
                print(f"         mend it: {finding.mend}")
    return 0 if all(finding.is_ok for finding in findings) else 1
