"""The supervisor with real processes and a real router: order, restart, stop, one log, nobody left behind."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from clients.stack import free_endpoint
from common.bus.session import Bus, BusAddress, Router
from common.errors import RequestError
from deploy.launch import StackError, Supervisor
from deploy.merged_log import MergedLog
from deploy.processes import Process, StackOptions
from deploy.rundir import RunDirectory
from tests.support.eventually import eventually
from tests.support.repository import ROOT

TINY = "tests.support.tiny_service"


def tiny(name: str, *flags: str, needs: tuple[str, ...] = ()) -> Process:
    return Process(name, TINY, needs=needs, arguments=(name, *flags))


@dataclass
class Running:
    """A supervisor at work in a thread of its own."""

    log_file: Path
    namespace: str
    is_over: bool = False
    failure: StackError | None = None
    should_stop: threading.Event = field(default_factory=threading.Event)

    def log(self) -> str:
        return self.log_file.read_text(encoding="utf-8")

    def pid_of(self, name: str) -> int:
        pids = [pid for pid, line in _command_lines() if re.search(f"{TINY} {name} .*{self.namespace}", line)]
        assert len(pids) <= 1, f"{name} runs {len(pids)} times"
        return pids[0] if pids else 0


def _command_lines() -> Iterator[tuple[int, str]]:
    """Process id and command line of all that runs; a bare Debian has no pgrep."""
    for entry in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):  # it has ended meanwhile
            yield int(entry.parent.name), entry.read_bytes().replace(b"\0", b" ").decode(errors="replace")


@pytest.fixture
def run(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Callable[..., Running]]:
    with ExitStack() as stack:

        def start(*processes: Process) -> Running:
            return stack.enter_context(supervised(tmp_path / "stack.log", request.node.name, processes))

        yield start


@contextmanager
def supervised(log_file: Path, namespace: str, processes: tuple[Process, ...]) -> Iterator[Running]:
    running = Running(log_file, namespace)
    options = StackOptions(BusAddress(free_endpoint(), namespace))

    def body() -> None:
        log = MergedLog(log_file, terminal=None)
        with Router(options.address.endpoint), Bus(options.address) as bus:
            supervisor = Supervisor(options, bus, log, processes)
            try:
                supervisor.run(running.should_stop.is_set)
            except StackError as error:
                running.failure = error
            supervisor.stop(lambda: False)
        log.close()
        running.is_over = True

    thread = threading.Thread(target=body)
    thread.start()
    try:
        eventually(log_file.exists, what="the log")
        yield running
    finally:
        running.should_stop.set()
        thread.join(20.0)
        assert not thread.is_alive(), "the supervisor did not stop"


def test_it_starts_in_order_of_readiness_and_stops_everything(run: Callable[..., Running]) -> None:
    running = run(tiny("robot"), tiny("cameras", needs=("robot",)))
    eventually(lambda: "the stack is ready" in running.log(), 20.0, "readiness")
    steps = re.findall(r"(robot|cameras): (starting|ready)", running.log())
    assert steps == [("robot", "starting"), ("robot", "ready"), ("cameras", "starting"), ("cameras", "ready")]
    pids = [running.pid_of("robot"), running.pid_of("cameras")]
    assert all(pids)
    running.should_stop.set()
    eventually(lambda: running.is_over and not any(Path(f"/proc/{pid}").exists() for pid in pids), 20.0, "the end of all")


def test_a_killed_process_comes_back(run: Callable[..., Running]) -> None:
    running = run(tiny("robot"))
    eventually(lambda: "the stack is ready" in running.log(), 20.0, "readiness")
    first = running.pid_of("robot")
    os.kill(first, signal.SIGKILL)
    eventually(lambda: running.log().count("the stack is ready") == 2, 20.0, "the second readiness")
    assert running.pid_of("robot") not in (0, first)
    assert "robot: ended by signal 9" in running.log()


def test_a_process_that_hangs_loses_its_token_and_is_replaced(run: Callable[..., Running]) -> None:
    running = run(tiny("robot"))
    eventually(lambda: "the stack is ready" in running.log(), 20.0, "readiness")
    first = running.pid_of("robot")
    os.kill(first, signal.SIGSTOP)
    eventually(lambda: running.log().count("the stack is ready") == 2, 30.0, "the second readiness")
    assert "no sign of life" in running.log()
    assert running.pid_of("robot") != first


def test_one_that_refuses_to_start_ends_the_stack(run: Callable[..., Running]) -> None:
    running = run(tiny("robot"), tiny("planner", "--refuse"))
    eventually(lambda: running.is_over, 20.0, "the end")
    assert re.search(r"planner +\| +config: no such thing", running.log())
    assert running.failure is not None
    assert running.failure.message == "planner cannot start: config: no such thing"


def test_restarts_of_a_crashing_process_slow_down(run: Callable[..., Running]) -> None:
    running = run(tiny("robot", "--crash-after-ready"))
    eventually(lambda: running.log().count("starts again in") >= 3, 30.0, "three crashes")
    delays = [float(text) for text in re.findall(r"starts again in ([\d.]+) s", running.log())]
    assert delays[:3] == sorted(delays[:3])
    assert delays[2] > delays[0]


def test_one_that_ignores_int_is_killed(run: Callable[..., Running]) -> None:
    running = run(tiny("robot", "--deaf"))
    eventually(lambda: "the stack is ready" in running.log(), 20.0, "readiness")
    pid = running.pid_of("robot")
    running.should_stop.set()
    eventually(lambda: not Path(f"/proc/{pid}").exists(), 20.0, "the end of the deaf one")
    assert "robot did not stop: killed" in running.log()


def test_every_line_names_its_process(run: Callable[..., Running]) -> None:
    running = run(tiny("robot"))
    eventually(lambda: "robot begins" in running.log(), 20.0, "the child's line")
    assert all(re.match(r"\d\d:\d\d:\d\d\.\d{3} (robot|supervisor) ", line) for line in running.log().splitlines())


def test_children_do_not_outlive_a_killed_parent(tmp_path: Path) -> None:
    program = (
        "import time\n"
        "from deploy.child import Child\n"
        "import sys\n"
        "command = [sys.executable, '-m', 'timeit', '-n', '1', '-r', '1', 'import time; time.sleep(600)']\n"
        "child = Child('sleeper', command, lambda *_: None)\n"
        "print(child.pid, flush=True)\n"
        "time.sleep(600)\n"
    )
    with subprocess.Popen([sys.executable, "-c", program], cwd=ROOT, stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        child_pid = int(parent.stdout.readline())
        command_line = Path(f"/proc/{child_pid}/cmdline")
        eventually(lambda: b"timeit" in command_line.read_bytes(), what="the child")
        parent.kill()
    eventually(lambda: not _runs(child_pid), what="the end of the child")


def _runs(pid: int) -> bool:
    try:
        return "\nState:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False


def test_a_run_directory_has_one_supervisor(tmp_path: Path) -> None:
    address = BusAddress("tcp/127.0.0.1:7447", "cell/1")
    mine, other = RunDirectory(address, base=tmp_path), RunDirectory(address, base=tmp_path)
    assert mine.running_pid() is None
    mine.claim()
    assert other.running_pid() == os.getpid()
    with pytest.raises(RequestError) as caught:
        other.claim()
    assert caught.value.code == "already_running"
    mine.release()
    assert other.running_pid() is None
    other.claim()
    other.release()


def test_a_pid_file_of_a_killed_supervisor_counts_for_nothing(tmp_path: Path) -> None:
    directory = RunDirectory(BusAddress(), base=tmp_path)
    directory.claim()
    directory.release()
    (directory.path / "supervisor.pid").write_text(f"{os.getpid()}\n")
    assert directory.running_pid() is None


def test_logs_of_former_starts_are_kept(tmp_path: Path) -> None:
    directory = RunDirectory(BusAddress(), base=tmp_path)
    directory.path.mkdir(parents=True)
    for n in range(8):
        directory.rotate_logs()
        directory.log_file.write_text(str(n))
    kept = {path.name: path.read_text() for path in directory.path.glob("stack.log*")}
    assert kept == {"stack.log": "7", "stack.log.1": "6", "stack.log.2": "5", "stack.log.3": "4", "stack.log.4": "3"}
