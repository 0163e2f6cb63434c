"""Where a running stack leaves its process id and its log: one directory per router endpoint and namespace."""

from __future__ import annotations

import fcntl
import os
import re
import tempfile
from pathlib import Path

from common.bus.session import BusAddress
from common.errors import RequestError

__all__ = ["RunDirectory"]

LOGS_KEPT = 5  # our choice


class RunDirectory:
    """``$XDG_RUNTIME_DIR/tolman/<endpoint>-<namespace>/`` or the same under the temporary directory, readable by its owner alone.

    The pid file is locked as long as its supervisor lives, so that a file left by a killed one is never mistaken for a running stack.
    """

    def __init__(self, address: BusAddress, *, base: Path | None = None) -> None:
        if base is None:
            runtime = os.environ.get("XDG_RUNTIME_DIR")
            base = Path(runtime) / "tolman" if runtime else Path(tempfile.gettempdir()) / f"tolman-{os.getuid()}"
        self.path = base / re.sub(r"[^A-Za-z0-9._-]+", "_", f"{address.endpoint}-{address.namespace}")
        self._pid_file = self.path / "supervisor.pid"
        self._lock: int | None = None

    def claim(self) -> None:
        """Create the directory and write this process's id into the locked pid file.

        Raises:
            RequestError: a supervisor runs here already (code ``already_running``).
        """
        self.path.mkdir(parents=True, exist_ok=True, mode=0o700)
        self._lock = os.open(self._pid_file, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            pid = self.running_pid()
            raise RequestError(f"a stack runs here already (pid {pid}, {self.path})", code="already_running", facts={"pid": pid}) from None
        os.ftruncate(self._lock, 0)
        os.write(self._lock, f"{os.getpid()}\n".encode())

    def release(self) -> None:
        """Empty and unlock the pid file."""
        if self._lock is not None:
            os.ftruncate(self._lock, 0)
            os.close(self._lock)
            self._lock = None

    def running_pid(self) -> int | None:
        """Process id of the supervisor that runs here, or None."""
        try:
            pid = int(self._pid_file.read_text())
            probe = os.open(self._pid_file, os.O_RDWR)
        except (OSError, ValueError):
            return None
        try:
            fcntl.flock(probe, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return pid
        finally:
            os.close(probe)
        return None

    @property
    def log_file(self) -> Path:
        """The log of the newest start."""
        return self.path / "stack.log"

    def rotate_logs(self) -> None:
        """Make way for this start's log; older ones are kept as ``stack.log.1`` (the newest of them) and so on."""
        for n in range(LOGS_KEPT - 1, 0, -1):
            older = self.log_file if n == 1 else self.path / f"stack.log.{n - 1}"
            if older.exists():
                older.replace(self.path / f"stack.log.{n}")
