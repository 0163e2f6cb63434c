"""What is kept between runs: the folder for it, and a lock beside a file, so that one process at a time makes it."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

__all__ = ["cache_dir", "locked"]


def cache_dir() -> Path:
    """``$XDG_CACHE_HOME/tolman`` (default ``~/.cache/tolman``), made if missing."""
    base = os.environ.get("XDG_CACHE_HOME")
    path = (Path(base) if base else Path.home() / ".cache") / "tolman"
    path.mkdir(parents=True, exist_ok=True)
    return path


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold the lock of ``path``: its name with the ending ``.lock``. Waits; a holder that ends, however that happens, lets go."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.with_suffix(".lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
