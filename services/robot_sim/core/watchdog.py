"""Whether the arm is seen for and thought for: liveliness, the planner's word and fresh exposures, judged at each cycle."""

from __future__ import annotations

from services.robot_sim.config import WatchdogConfig

__all__ = ["Watchdog"]

SENSES = ("planner", "perception", "cameras")
NS = 1_000_000_000


class Watchdog:
    """Knows when each sense was last heard of; all instants are monotonic nanoseconds of this machine."""

    def __init__(self, config: WatchdogConfig) -> None:
        self._config = config
        self._alive = dict.fromkeys(SENSES, False)
        self._status_ns: int | None = None
        self._exposure_ns: int | None = None

    def set_alive(self, owner: str, alive: bool) -> None:
        """A liveliness token came or went; owners that the arm's safety does not rest on are ignored."""
        if owner in self._alive:
            self._alive[owner] = alive

    def heard_status(self, arrival_ns: int) -> None:
        """A ``planner/status`` arrived."""
        self._status_ns = arrival_ns

    def saw_exposure(self, exposure_ns: int) -> None:
        """An exposure of this instant went into the cells; older than one known already changes nothing."""
        self._exposure_ns = exposure_ns if self._exposure_ns is None else max(self._exposure_ns, exposure_ns)

    def lost(self, now_ns: int) -> str:
        """What is missing now, as a reason for people; empty when all is there."""
        for owner in SENSES:
            if not self._alive[owner]:
                return f"{owner} is not there"
        for what, at_ns, timeout_s in (
            ("planner/status", self._status_ns, self._config.status_timeout_s),
            ("exposure", self._exposure_ns, self._config.exposure_timeout_s),
        ):
            if at_ns is None or now_ns - at_ns > timeout_s * NS:
                return f"no fresh {what} for {timeout_s:g} s"
        return ""
