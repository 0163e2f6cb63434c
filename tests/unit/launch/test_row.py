"""What the supervisor does with a row of the table, as a function of what it sees."""

from __future__ import annotations

import pytest

from common.bus.session import BusAddress
from common.wire.keys import OWNERS
from deploy.processes import PROCESSES, Process, StackOptions, command_line
from deploy.restart import FIRST_DELAY_S, HEALTHY_AFTER_S, LONGEST_DELAY_S, Backoff
from deploy.row import LOST_AFTER_S, Action, Phase, Row

SERVICE = Process("planner", "services.planner", ready_within_s=10.0)
PREPARATION = Process("map", "clients.cli.main", is_preparation=True, ready_within_s=100.0)


def started(process: Process = SERVICE) -> Row:
    row = Row(process)
    assert row.step(0.0, exit_code=None, is_alive=False, needs_met=True) is Action.START
    return row


def ready(at_s: float = 1.0) -> Row:
    row = started()
    assert row.step(at_s, exit_code=None, is_alive=True, needs_met=True) is Action.NONE
    assert row.phase is Phase.READY
    return row


def test_it_waits_for_what_it_needs() -> None:
    row = Row(SERVICE)
    assert row.step(0.0, exit_code=None, is_alive=False, needs_met=False) is Action.NONE
    assert row.step(1.0, exit_code=None, is_alive=False, needs_met=True) is Action.START
    assert row.step(1.1, exit_code=None, is_alive=False, needs_met=True) is Action.NONE
    assert not row.satisfies


def test_the_token_makes_it_ready() -> None:
    assert ready().satisfies


def test_a_process_that_never_gets_ready_is_killed_once() -> None:
    row = started()
    assert row.step(9.9, exit_code=None, is_alive=False, needs_met=True) is Action.NONE
    assert row.step(10.1, exit_code=None, is_alive=False, needs_met=True) is Action.KILL
    assert row.step(10.2, exit_code=None, is_alive=False, needs_met=True) is Action.NONE
    row.step(10.3, exit_code=-9, is_alive=False, needs_met=True)
    assert row.phase is Phase.DOWN


def test_a_killed_process_starts_again_after_the_delay() -> None:
    row = ready()
    row.step(30.0, exit_code=-9, is_alive=False, needs_met=True)
    assert row.phase is Phase.DOWN
    assert "signal 9" in row.note
    assert row.step(30.0 + FIRST_DELAY_S - 0.01, exit_code=-9, is_alive=False, needs_met=True) is Action.NONE
    assert row.step(30.0 + FIRST_DELAY_S, exit_code=-9, is_alive=False, needs_met=True) is Action.START


def test_a_lost_token_is_forgiven_for_a_while_then_the_process_is_killed() -> None:
    row = ready(1.0)
    assert row.step(2.0, exit_code=None, is_alive=False, needs_met=True) is Action.NONE
    assert row.step(2.5, exit_code=None, is_alive=True, needs_met=True) is Action.NONE
    assert row.step(2.5 + LOST_AFTER_S, exit_code=None, is_alive=False, needs_met=True) is Action.NONE
    assert row.step(2.6 + LOST_AFTER_S, exit_code=None, is_alive=False, needs_met=True) is Action.KILL


def test_one_that_says_why_it_cannot_start_is_not_tried_again() -> None:
    row = started()
    row.step(1.0, exit_code=2, is_alive=False, needs_met=True)
    assert row.phase is Phase.FAILED


def test_the_same_exit_after_it_had_served_is_tried_again() -> None:
    row = ready()
    row.step(5.0, exit_code=2, is_alive=False, needs_met=True)
    assert row.phase is Phase.DOWN


def test_a_preparation_is_done_when_it_ends_well() -> None:
    row = started(PREPARATION)
    row.step(60.0, exit_code=0, is_alive=False, needs_met=True)
    assert row.phase is Phase.DONE
    assert row.satisfies
    assert row.step(61.0, exit_code=0, is_alive=False, needs_met=True) is Action.NONE


def test_a_preparation_that_fails_ends_the_stack() -> None:
    row = started(PREPARATION)
    row.step(60.0, exit_code=1, is_alive=False, needs_met=True)
    assert row.phase is Phase.FAILED


def test_backoff_doubles_up_to_its_bound_and_starts_anew_after_a_healthy_run() -> None:
    backoff = Backoff()
    delays = [backoff.after_exit(0.0) for _ in range(10)]
    assert delays[0] == FIRST_DELAY_S
    assert delays[1] == 2 * FIRST_DELAY_S
    assert delays == sorted(delays)
    assert delays[-1] == LONGEST_DELAY_S
    assert backoff.after_exit(HEALTHY_AFTER_S) == FIRST_DELAY_S


def test_the_table_names_every_owner_once_and_needs_only_what_it_has() -> None:
    names = [process.name for process in PROCESSES]
    assert sorted(name for name in names if name in OWNERS) == sorted(OWNERS)
    assert len(set(names)) == len(names)
    for n, process in enumerate(PROCESSES):
        assert set(process.needs) <= set(names[:n]), f"{process.name} needs what comes later: the table is its own order"


@pytest.mark.parametrize("process", PROCESSES, ids=lambda process: process.name)
def test_a_command_line_carries_config_and_overrides(process: Process) -> None:
    line = command_line(process, StackOptions(BusAddress("tcp/h:1", "cell"), overrides=("planner.rules=paper",)))
    assert line[1:3] == ["-m", process.module]
    assert line[line.index("--set") + 1] == "planner.rules=paper"
    assert ("--connect" in line) == (not process.is_preparation)
