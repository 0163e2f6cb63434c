"""One child process: started in its own group, tied to the supervisor's life, its lines passed on, stopped INT - wait - KILL.

As a program (``python -m deploy.child PARENT_PID MODULE ARGUMENTS...``) this module is the first thing that a child runs: it asks the
kernel to be killed when the supervisor dies, then becomes the module. Done here rather than between fork and exec, where Python code
beside Zenoh's threads would not be safe.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import runpy
import signal
import subprocess
import sys
import threading
from collections.abc import Callable

__all__ = ["Child"]

PR_SET_PDEATHSIG = 1  # linux/prctl.h


class Child:
    """A running child. Make it in the supervisor's main thread: the kernel's death signal follows the thread that forked."""

    def __init__(self, name: str, command: list[str], on_line: Callable[[str, str], None]) -> None:
        self.name = name
        python, dash_m, *rest = command
        self._process = subprocess.Popen(
            [python, dash_m, "deploy.child", str(os.getpid()), *rest],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,  # Ctrl-C in the terminal reaches the supervisor alone
            text=True,
            errors="replace",
        )
        self._pump = threading.Thread(target=self._pass_lines, args=(on_line,), name=f"log-{name}", daemon=True)
        self._pump.start()

    def _pass_lines(self, on_line: Callable[[str, str], None]) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            on_line(self.name, line.rstrip("\n"))

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    def exit_code(self) -> int | None:
        """None while it runs; negative: the signal that ended it."""
        return self._process.poll()

    def interrupt(self) -> None:
        """Ask it to close in order."""
        self._signal(signal.SIGINT)

    def kill(self) -> None:
        """End it and whatever it started, at once."""
        self._signal(signal.SIGKILL)

    def wait(self, timeout_s: float) -> bool:
        """True when it ended within the time; then its last lines were passed on too."""
        try:
            self._process.wait(max(timeout_s, 0.0))
        except subprocess.TimeoutExpired:
            return False
        self._pump.join(1.0)
        return True

    def _signal(self, number: signal.Signals) -> None:
        if self._process.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._process.pid, number)


def _die_with(parent_pid: int) -> None:
    if sys.platform != "linux":  # elsewhere the supervisor's own stop must do
        return
    ctypes.CDLL(None, use_errno=True).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent_pid:  # the parent died before the request was in force
        os._exit(1)


def main() -> None:
    """Become the module named on the command line."""
    parent_pid, module, *arguments = sys.argv[1:]
    _die_with(int(parent_pid))
    sys.argv = [module, *arguments]
    try:
        runpy.run_module(module, run_name="__main__", alter_sys=True)
    except KeyboardInterrupt:  # asked to stop before the module could listen for it
        sys.exit(128 + signal.SIGINT)


if __name__ == "__main__":
    main()
