"""One row of the process table while the stack runs: what to do with it next. Pure: time and observations are arguments."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum, auto

from deploy.processes import Process
from deploy.restart import Backoff

__all__ = ["Action", "Phase", "Row"]

LOST_AFTER_S = 3.0  # our choice: longer than Zenoh's lease of 2 s, so that one lost link is not taken for a hanging process
EXIT_TOLD = 2  # what a service returns when it said on its log why it cannot start


class Phase(Enum):
    """Where a row stands."""

    WAITING = auto()
    STARTING = auto()
    READY = auto()
    DOWN = auto()
    DONE = auto()
    FAILED = auto()


class Action(Enum):
    """What the supervisor has to do."""

    NONE = auto()
    START = auto()
    KILL = auto()


@dataclass
class Row:
    """State machine of one row; :meth:`step` is called several times a second.

    Attributes:
        process: the row of the table.
        phase: where it stands.
        since_s: monotonic seconds of the last change of phase.
        note: what changed last, for the log; empty when nothing did.
    """

    process: Process
    phase: Phase = Phase.WAITING
    since_s: float = 0.0
    note: str = ""
    _backoff: Backoff = field(default_factory=Backoff)
    _start_at_s: float = 0.0
    _was_ready: bool = False
    _seen_alive_s: float = 0.0
    _is_killed: bool = False

    @property
    def satisfies(self) -> bool:
        """Whether rows that need this one may start."""
        return self.phase in (Phase.READY, Phase.DONE)

    def step(self, now_s: float, *, exit_code: int | None, is_alive: bool, needs_met: bool) -> Action:
        """Take what is seen now.

        Args:
            now_s: monotonic time.
            exit_code: of the child under way; None while it runs or before there is one.
            is_alive: its liveliness token is there.
            needs_met: all rows that it needs satisfy.
        """
        self.note = ""
        if self.phase is Phase.WAITING and needs_met:
            return self._start(now_s)
        if self.phase is Phase.DOWN and now_s >= self._start_at_s:
            return self._start(now_s)
        if self.phase in (Phase.STARTING, Phase.READY):
            if exit_code is not None:
                return self._ended(now_s, exit_code)
            return self._starting(now_s, is_alive) if self.phase is Phase.STARTING else self._ready(now_s, is_alive)
        return Action.NONE

    def _start(self, now_s: float) -> Action:
        self._is_killed = False
        self._enter(Phase.STARTING, now_s, "starting")
        return Action.START

    def _starting(self, now_s: float, is_alive: bool) -> Action:
        if is_alive and not self.process.is_preparation:
            self._was_ready = True
            self._seen_alive_s = now_s
            seconds = now_s - self.since_s
            self._enter(Phase.READY, now_s, f"ready after {seconds:.1f} s")
        elif now_s - self.since_s > self.process.ready_within_s:
            return self._kill(f"not ready within {self.process.ready_within_s:g} s")
        return Action.NONE

    def _ready(self, now_s: float, is_alive: bool) -> Action:
        if is_alive:
            self._seen_alive_s = now_s
        elif now_s - self._seen_alive_s > LOST_AFTER_S:
            return self._kill(f"runs but shows no sign of life for {LOST_AFTER_S:g} s")
        return Action.NONE

    def _kill(self, why: str) -> Action:
        if self._is_killed:
            return Action.NONE
        self._is_killed = True
        self.note = f"{why}: killed"
        return Action.KILL

    def _ended(self, now_s: float, exit_code: int) -> Action:
        if self.process.is_preparation and exit_code == 0:
            self._enter(Phase.DONE, now_s, f"done after {now_s - self.since_s:.1f} s")
        elif self.process.is_preparation or (exit_code == EXIT_TOLD and not self._was_ready):
            self._enter(Phase.FAILED, now_s, f"cannot start (exit code {exit_code})")
        else:
            served_s = now_s - self.since_s if self.phase is Phase.READY else 0.0
            delay_s = self._backoff.after_exit(served_s)
            self._start_at_s = now_s + delay_s
            how = f"signal {-exit_code}" if exit_code < 0 else f"exit code {exit_code}"
            self._enter(Phase.DOWN, now_s, f"ended by {how}; starts again in {delay_s:g} s")
        return Action.NONE

    def _enter(self, phase: Phase, now_s: float, note: str) -> None:
        self.phase, self.since_s, self.note = phase, now_s, note
