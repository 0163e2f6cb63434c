"""What ``tolman bench learned`` refuses before it goes to work."""

from __future__ import annotations

import pytest

from clients.cli.main import main


@pytest.mark.parametrize(("option", "value"), [("--n", "0"), ("--n", "-3"), ("--old", "0")])
def test_no_question_is_refused_by_name(option: str, value: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "learned", option, value]) != 0
    assert f"{option} {value}" in capsys.readouterr().err
