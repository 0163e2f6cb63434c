"""Doctor: nothing missing here, and what is missing elsewhere is named with the line that mends it."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from clients.cli import doctor
from clients.cli.main import main
from clients.stack import free_endpoint
from common.bus import session
from tests.support.repository import ROOT


def test_this_machine_lacks_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    main(["doctor", "--json"])
    findings = json.loads(capsys.readouterr().out)
    missing = [finding for finding in findings if not finding["is_ok"] and finding["name"] != "cores"]
    assert missing == []


def test_a_missing_package_is_named_with_its_cure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(doctor.DISTRIBUTIONS, "no-such-distribution", "nothing")
    (finding,) = doctor.python_packages()
    assert not finding.is_ok
    assert "no-such-distribution" in finding.name
    assert finding.mend == "make setup"


def test_a_missing_library_is_named_with_its_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "_system_packages", lambda: [("libnowhere0", "libnowhere.so.0")])
    (finding,) = doctor.system_libraries()
    assert not finding.is_ok
    assert finding.mend.endswith("libnowhere0")


def test_a_module_that_does_not_load_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "FRAIL_MODULES", ("no_such_module_at_all",))
    (finding,) = doctor.compiled_modules()
    assert not finding.is_ok
    assert "no_such_module_at_all" in finding.detail


def test_a_taken_port_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    endpoint = free_endpoint()
    monkeypatch.setattr(session, "DEFAULT_ENDPOINT", endpoint)
    with session.Router(endpoint):
        (finding,) = doctor.bus_port()
    assert not finding.is_ok
    (finding,) = doctor.bus_port()
    assert finding.is_ok


def test_it_runs_where_nothing_is_installed() -> None:
    program = "import sys; sys.path.insert(0, sys.argv[1]); from clients.cli.main import main; sys.exit(main(['doctor']))"
    result = subprocess.run([sys.executable, "-I", "-S", "-c", program, str(ROOT)], capture_output=True, text=True, check=False)
    assert result.returncode == 1, result.stderr
    assert "make setup" in result.stdout
