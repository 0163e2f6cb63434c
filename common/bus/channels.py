"""What passes through a session by key: inboxes, publishers, commands.

A Zenoh callback never decodes, blocks or calls Zenoh: it stores the payload and sets the wake event; the owner's loop
(:mod:`common.bus.service`) does the rest. Inboxes for state keep the newest sample only, because a queue of state is a queue of stale
state; lossless channels and commands queue.
"""

from __future__ import annotations

import threading
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

import msgspec
import zenoh

from common.clock import monotonic_ns, utc_ns
from common.errors import RequestError, TolmanError, WireError
from common.wire import keys
from common.wire.codec import decode, encode, encoding_of
from common.wire.messages import ErrorReply, Message

if TYPE_CHECKING:
    from common.bus.session import Bus

__all__ = ["COMMAND_QUEUE_LENGTH", "Command", "Commands", "Latest", "Queue", "Received", "StatePublisher"]

M = TypeVar("M", bound=Message)

QUEUE_LENGTH = 256
COMMAND_QUEUE_LENGTH = 64


@dataclass(frozen=True)
class Received(Generic[M]):
    """A decoded message with the moment of its arrival on this machine's monotonic clock."""

    message: M
    arrival_ns: int
    key: str


class _Decoding(Generic[M]):
    """Shared by inboxes: decode in the owner's thread, count and log what cannot be decoded."""

    def __init__(self, bus: Bus, kind: type[M]) -> None:
        self._bus = bus
        self._kind = kind

    def _decode(self, raw: tuple[bytes, int, str]) -> Received[M] | None:
        payload, arrival_ns, key = raw
        try:
            return Received(decode(payload, self._kind), arrival_ns, key)
        except WireError as error:
            self._bus.complain(f"{key}: {error.message}", subject=key)
            return None


class Latest(_Decoding[M]):
    """Newest-only inbox of one state key (or of each key that matches a wildcard)."""

    def __init__(self, bus: Bus, key: str, kind: type[M]) -> None:
        super().__init__(bus, kind)
        self._lock = threading.Lock()
        self._raw: dict[str, tuple[bytes, int, str]] = {}
        self._subscriber = bus.session.declare_subscriber(key, self._on_sample)

    def _on_sample(self, sample: zenoh.Sample) -> None:
        key = str(sample.key_expr)
        raw = (bytes(sample.payload), monotonic_ns(), key)
        with self._lock:
            self._raw[key] = raw
        self._bus.wake.set()

    def take(self) -> Received[M] | None:
        """The newest sample that was not taken yet, or None."""
        taken = self.take_all()
        return taken[-1] if taken else None

    def take_all(self) -> list[Received[M]]:
        """The newest untaken sample of each matching key, oldest arrival first."""
        with self._lock:
            raws, self._raw = list(self._raw.values()), {}
        raws.sort(key=lambda raw: raw[1])
        return [r for r in map(self._decode, raws) if r is not None]


class Queue(_Decoding[M]):
    """Inbox that keeps every sample in order (for lossless channels), bounded; overflow is counted."""

    def __init__(self, bus: Bus, key: str, kind: type[M]) -> None:
        super().__init__(bus, kind)
        self._raw: deque[tuple[bytes, int, str]] = deque(maxlen=QUEUE_LENGTH)
        self._subscriber = bus.session.declare_subscriber(key, self._on_sample)

    def _on_sample(self, sample: zenoh.Sample) -> None:
        if len(self._raw) == QUEUE_LENGTH:
            self._bus.count("queue_overflow")
        self._raw.append((bytes(sample.payload), monotonic_ns(), str(sample.key_expr)))
        self._bus.wake.set()

    def take_all(self) -> list[Received[M]]:
        """All samples since the last call."""
        out = []
        while self._raw:
            received = self._decode(self._raw.popleft())
            if received is not None:
                out.append(received)
        return out


class StatePublisher(Generic[M]):
    """Publishes a state and answers ``get`` on its key with the last payloads (late joiners, one-shot clients)."""

    def __init__(self, bus: Bus, key: str, kind: type[M], *, history: int = 1) -> None:
        self._bus = bus
        self._key = key
        self._encoding = zenoh.Encoding(encoding_of(kind))
        self._seq = 0
        self._last: deque[bytes] = deque(maxlen=history)
        lossless = keys.channel(key).lossless
        self._publisher = bus.session.declare_publisher(
            key,
            encoding=self._encoding,
            congestion_control=zenoh.CongestionControl.BLOCK if lossless else zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.REAL_TIME if lossless else zenoh.Priority.DATA,
            express=True,
        )
        self._queryable = bus.session.declare_queryable(key, self._on_get, complete=True)

    def publish(self, message: M, *, stamp_ns: int | None = None) -> M:
        """Send with the header filled in (``stamp_ns`` now unless given) and return what was sent."""
        self._seq += 1
        stamped = msgspec.structs.replace(
            message, stamp_ns=utc_ns() if stamp_ns is None else stamp_ns, epoch=self._bus.epoch, seq=self._seq
        )
        payload = encode(stamped)
        self._last.append(payload)
        self._publisher.put(payload)
        return stamped

    def _on_get(self, query: zenoh.Query) -> None:
        self._bus.replies.append((query, self._key, list(self._last), self._encoding))
        self._bus.wake.set()


def _fail(query: zenoh.Query, error: TolmanError) -> None:
    body = ErrorReply(code=error.code, message=error.message, facts=error.facts)
    with suppress(zenoh.ZError):  # the asker may be gone; that is its affair
        query.reply_err(encode(body), encoding=zenoh.Encoding(encoding_of(ErrorReply)))
        query.drop()


class Command(Generic[M]):
    """One received command; answer it exactly once with :meth:`reply` or :meth:`fail`."""

    def __init__(self, query: zenoh.Query, request: M, arrival_ns: int) -> None:
        self._query = query
        self.request = request
        self.arrival_ns = arrival_ns

    def reply(self, message: Message) -> None:
        """Answer."""
        with suppress(zenoh.ZError):  # the asker may be gone; that is its affair
            self._query.reply(self._query.key_expr, encode(message), encoding=zenoh.Encoding(encoding_of(type(message))))
            self._query.drop()

    def fail(self, error: TolmanError) -> None:
        """Answer with an error reply."""
        _fail(self._query, error)


class Commands(Generic[M]):
    """Bounded queue of commands on one key. Undecodable ones are answered with an error by the loop; overflow likewise."""

    def __init__(self, bus: Bus, key: str, kind: type[M]) -> None:
        self._bus = bus
        self._kind = kind
        self._raw: deque[tuple[zenoh.Query, bytes, int]] = deque()
        self._queryable = bus.session.declare_queryable(key, self._on_query, complete=True)

    def _on_query(self, query: zenoh.Query) -> None:
        payload = bytes(query.payload) if query.payload is not None else b"\x80"  # no payload = empty map
        self._raw.append((query, payload, monotonic_ns()))
        self._bus.wake.set()

    def take_all(self) -> list[Command[M]]:
        """All well-formed commands since the last call."""
        out: list[Command[M]] = []
        while self._raw:
            query, payload, arrival_ns = self._raw.popleft()
            if len(out) >= COMMAND_QUEUE_LENGTH:
                _fail(query, RequestError("too many commands are waiting", code="busy"))
                continue
            try:
                out.append(Command(query, decode(payload, self._kind), arrival_ns))
            except WireError as error:
                self._bus.complain(f"{query.key_expr}: {error.message}", subject=str(query.key_expr))
                _fail(query, error)
        return out
