"""What a client can see of a running stack: newest message, rate, age and latency of every state channel; health of every owner."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from common.bus.channels import Received
from common.bus.session import Bus, RemoteError
from common.clock import monotonic_ns, utc_ns
from common.errors import WireError
from common.wire import keys
from common.wire.messages import Empty, ServiceHealth, State

__all__ = ["ChannelFigures", "ChannelWatch", "Monitor"]

WINDOW_NS = 2_000_000_000  # our choice: long enough for 10 Hz, short enough to see a stall
LATENCIES_KEPT = 512
HEALTH_TIMEOUT_S = 0.3  # our choice: a table that refreshes twice a second cannot wait longer


@dataclass(frozen=True)
class ChannelFigures:
    """One channel now. ``latency_ms``: stamp of the message to its arrival here, median (sender's and receiver's UTC compared)."""

    key: str
    rate_hz: float
    age_ms: float
    latency_ms: float
    total: int


@dataclass
class ChannelWatch:
    """Counts one channel by its sequence numbers, so that samples a newest-only inbox skipped are counted too.

    Rates are the publisher's; what the network dropped is not told apart.
    """

    key: str
    newest: Any = None
    total: int = 0
    first_ns: int = 0
    last_ns: int = 0
    _window: deque[tuple[int, int]] = field(default_factory=deque)
    _latencies_ms: deque[float] = field(default_factory=lambda: deque(maxlen=LATENCIES_KEPT))

    def observe(self, message: State, arrival_ns: int, utc_minus_monotonic_ns: int) -> None:
        """Take one sample; a new epoch (a restarted publisher) counts as one."""
        before = self.newest
        is_same_run = before is not None and before.epoch == message.epoch and message.seq > before.seq
        self.total += message.seq - before.seq if is_same_run else 1
        if before is None:
            self.first_ns = arrival_ns
        self.newest, self.last_ns = message, arrival_ns
        self._window.append((arrival_ns, self.total))
        self._latencies_ms.append((arrival_ns + utc_minus_monotonic_ns - message.stamp_ns) / 1e6)

    def figures(self, now_ns: int) -> ChannelFigures:
        """Rate over the last two seconds, age of the newest sample, median latency."""
        while len(self._window) > 1 and now_ns - self._window[0][0] > WINDOW_NS:
            self._window.popleft()
        (t0, n0), (t1, n1) = self._window[0], self._window[-1]
        is_current = now_ns - t1 < WINDOW_NS
        rate_hz = (n1 - n0) / ((t1 - t0) / 1e9) if is_current and t1 > t0 else 0.0
        return ChannelFigures(self.key, rate_hz, (now_ns - t1) / 1e6, float(np.median(self._latencies_ms)), self.total)

    def mean_rate_hz(self) -> float:
        """Over everything seen so far."""
        seconds = (self.last_ns - self.first_ns) / 1e9
        return (self.total - 1) / seconds if seconds > 0 else 0.0


class Monitor:
    """Subscribes to every state channel of the contract. Call :meth:`update` when the bus wakes."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        states = [channel for channel in keys.CHANNELS if channel.kind is keys.Kind.STATE]
        self._inboxes = [bus.latest(channel.key, channel.message) for channel in states]
        self.channels: dict[str, ChannelWatch] = {}
        self.alive: dict[str, bool] = dict.fromkeys(keys.OWNERS, False)
        self.health: dict[str, ServiceHealth] = {}
        bus.watch_alive(self.alive.__setitem__)

    def update(self) -> list[Received[Any]]:
        """Take in what has come; returns it."""
        offset_ns = utc_ns() - monotonic_ns()
        news: list[Received[Any]] = []
        for inbox in self._inboxes:
            news += inbox.take_all()
        for received in news:
            watch = self.channels.setdefault(received.key, ChannelWatch(received.key))
            watch.observe(received.message, received.arrival_ns, offset_ns)
        return news

    def ask_health(self) -> None:
        """Renew :attr:`health`; an owner that does not answer drops out of it."""
        self.health = {}
        for owner in (owner for owner, is_alive in list(self.alive.items()) if is_alive):
            try:
                self.health[owner] = self._bus.request(keys.health(owner), Empty(), ServiceHealth, timeout_s=HEALTH_TIMEOUT_S)
            except (RemoteError, WireError):
                continue

    def newest(self, key: str) -> Any:
        """The newest message of a key, or None."""
        watch = self.channels.get(key)
        return None if watch is None else watch.newest

    def figures(self) -> list[ChannelFigures]:
        """All channels that were ever heard, by key."""
        now_ns = monotonic_ns()
        return [self.channels[key].figures(now_ns) for key in sorted(self.channels)]
