"""The files of this repository, as the architecture tests read them."""

from __future__ import annotations

import subprocess
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TEXT_SUFFIXES = {".py", ".md", ".toml", ".txt", ".yml", ".yaml", ".json5", ".sh", ".cfg", ""}


@cache
def tracked_files() -> tuple[Path, ...]:
    """Everything git tracks, or would (new files that are not ignored)."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return tuple(path for name in listed.stdout.splitlines() if (path := ROOT / name).is_file())


def text_files() -> list[Path]:
    """Those that hold text."""
    return [path for path in tracked_files() if path.suffix in TEXT_SUFFIXES]
