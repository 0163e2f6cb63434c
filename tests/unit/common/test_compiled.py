from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from common.compiled import VARIABLE, digest_of_kernels, keep_compiled_kernels

KERNEL = "from numba import njit\n@njit(cache=True)\ndef f():\n    return {}\n"
CALLER = "from numba import njit\nfrom common.kernel import f\n@njit(cache=True)\ndef g():\n    return f()\nprint(g())\n"


def _tree(root: Path, value: int) -> None:
    for package in ("common", "services"):
        (root / package).mkdir(exist_ok=True)
    (root / "common" / "kernel.py").write_text(KERNEL.format(value), encoding="utf-8")
    (root / "services" / "caller.py").write_text(CALLER, encoding="utf-8")


def _run(root: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.delenv(VARIABLE, raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(root / "cache"))
    monkeypatch.setenv("PYTHONPATH", str(root))
    keep_compiled_kernels(root)
    line = [sys.executable, str(root / "services" / "caller.py")]
    return subprocess.run(line, check=True, capture_output=True, text=True).stdout.strip()


def test_a_changed_callee_is_never_stale(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With numba's own rule the second run prints 1: the caller's file did not change."""
    _tree(tmp_path, 1)
    assert _run(tmp_path, monkeypatch) == "1"
    _tree(tmp_path, 2)
    assert _run(tmp_path, monkeypatch) == "2"
    assert len(list((tmp_path / "cache" / "tolman").glob("kernels-*"))) == 2


def test_the_environment_has_the_last_word(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "elsewhere")
    keep_compiled_kernels()
    import os

    assert os.environ[VARIABLE] == "elsewhere"


def test_only_kernels_count(tmp_path: Path) -> None:
    _tree(tmp_path, 1)
    before = digest_of_kernels(tmp_path)
    (tmp_path / "common" / "words.py").write_text("x = 1\n", encoding="utf-8")
    assert digest_of_kernels(tmp_path) == before
