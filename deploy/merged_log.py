"""One log of all processes: every line names its process, goes to the terminal (unless quiet) and into a file."""

from __future__ import annotations

import re
import sys
import threading
from datetime import datetime
from pathlib import Path
from typing import TextIO

__all__ = ["MergedLog", "named"]

_STAMPED = re.compile(r"^\d\d:\d\d:\d\d\.\d{3} ")


def named(process: str, line: str, now: datetime) -> str:
    """The line as it stands in the merged log. Lines of :mod:`common.log` carry time and process already; others get both."""
    if _STAMPED.match(line):
        return line
    return f"{now:%H:%M:%S}.{now.microsecond // 1000:03d} {process:<10} {'|':<7} {line}"


class MergedLog:
    """Sink of the children's lines; callable from their pump threads."""

    def __init__(self, path: Path, *, terminal: TextIO | None = sys.stderr) -> None:
        self._file = path.open("w", encoding="utf-8", buffering=1)
        self._terminal = terminal
        self._lock = threading.Lock()
        self._last: dict[str, str] = {}

    def last_line(self, process: str) -> str:
        """What a process said last, without time and name; empty if nothing."""
        return self._last.get(process, "")

    def write(self, process: str, line: str) -> None:
        """Pass one line on."""
        text = named(process, line, datetime.now()) + "\n"
        with self._lock:
            self._last[process] = line.split(process, 1)[-1].strip() if _STAMPED.match(line) else line
            if self._file.closed:
                return
            self._file.write(text)
            if self._terminal is not None:
                self._terminal.write(text)
                self._terminal.flush()

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._file.close()
