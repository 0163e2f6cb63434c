"""A stack that this process started: its supervisor as a child, its readiness, its end."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections import deque
from pathlib import Path

from clients.waiting import wait_for_owners
from common.bus.session import Bus, BusAddress, RemoteError
from deploy.processes import StackOptions
from deploy.rundir import RunDirectory

__all__ = ["OwnStack", "free_endpoint", "is_free", "launch_arguments"]

STOP_WITHIN_S = 15.0  # the supervisor itself kills after 5 s, see deploy.launch
READY_WITHIN_S = 1800.0  # our choice: the first start of all builds the map
LINES_OF_TROUBLE = 15


def free_endpoint() -> str:
    """A loopback endpoint whose port nobody listens on now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def is_free(endpoint: str) -> bool:
    """Whether a router could listen at a ``tcp/<host>:<port>`` endpoint of this machine now."""
    host, _, port = endpoint.removeprefix("tcp/").rpartition(":")
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, int(port)))
        except OSError:
            return False
    return True


def launch_arguments(options: StackOptions) -> list[str]:
    """Command line of the supervisor's module."""
    line = ["--connect", options.address.endpoint, "--namespace", options.address.namespace, "--log-level", options.log_level]
    if options.config is not None:
        line += ["--config", str(options.config)]
    for override in options.overrides:
        line += ["--set", override]
    return line


class OwnStack:
    """Starts the supervisor at once. With ``is_tied`` it does not outlive this process, not even a killed one."""

    def __init__(self, options: StackOptions, *, is_tied: bool = True) -> None:
        self.options = options
        self._directory = RunDirectory(options.address)
        module = ["deploy.child", str(os.getpid()), "deploy.launch"] if is_tied else ["deploy.launch"]
        self._process = subprocess.Popen(
            [sys.executable, "-m", *module, *launch_arguments(options), "--quiet"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )

    @property
    def address(self) -> BusAddress:
        """Where its router is."""
        return self.options.address

    @property
    def log_file(self) -> Path:
        """The merged log."""
        return self._directory.log_file

    def connect(self, timeout_s: float = 20.0) -> Bus:
        """A session with its router, as soon as that is up.

        Raises:
            RemoteError: the supervisor ended (its last words are in the message) or there is no router in time.
        """
        deadline_s = time.monotonic() + timeout_s
        while True:
            self._raise_if_ended()
            try:
                return Bus(self.address, connect_timeout_s=0.2)
            except RemoteError:
                if time.monotonic() > deadline_s:
                    raise

    def wait_ready(self, bus: Bus, timeout_s: float = READY_WITHIN_S) -> None:
        """Until every owner shows its liveliness token.

        Raises:
            RemoteError: not in time, or the supervisor ended; the end of the log is in the message.
        """
        missing = wait_for_owners(bus, timeout_s, self._raise_if_ended)
        if missing:
            raise RemoteError(f"not ready within {timeout_s:g} s: {', '.join(missing)}\n{self._last_lines()}", code="not_ready")

    def stop(self) -> None:
        """INT, wait, KILL."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(STOP_WITHIN_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _raise_if_ended(self) -> None:
        code = self._process.poll()
        if code is not None:
            assert self._process.stderr is not None
            words = self._process.stderr.read().decode(errors="replace").strip()
            raise RemoteError(f"the stack ended (exit code {code})\n{words or self._last_lines()}", code="stack_ended")

    def _last_lines(self) -> str:
        try:
            with self.log_file.open(encoding="utf-8", errors="replace") as file:
                return "".join(deque(file, LINES_OF_TROUBLE)).rstrip()
        except OSError:
            return f"(no log at {self.log_file})"
