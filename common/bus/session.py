"""The only module that imports zenoh: sessions, inboxes, publishers, commands, liveliness.

Every process is a client of one router. A Zenoh callback never decodes, blocks or calls Zenoh: it stores the payload and sets the
wake event; the owner's loop (:mod:`common.bus.service`) does the rest. Inboxes for state keep the newest sample only, because
a queue of state is a queue of stale state; lossless channels and commands queue.
"""

from __future__ import annotations

import json
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import msgspec
import zenoh

from common.clock import monotonic_ns, utc_ns
from common.errors import RequestError, TolmanError, WireError
from common.log import RateLimit
from common.wire import keys
from common.wire.codec import decode, encode, encoding_of
from common.wire.messages import ErrorReply, Message

__all__ = [
    "DEFAULT_ENDPOINT",
    "DEFAULT_NAMESPACE",
    "Bus",
    "BusAddress",
    "Command",
    "Commands",
    "Latest",
    "Queue",
    "Received",
    "RemoteError",
    "Router",
    "StatePublisher",
]

M = TypeVar("M", bound=Message)
R = TypeVar("R", bound=Message)

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"  # Zenoh's registered port
DEFAULT_NAMESPACE = "tolman"
LEASE_MS = 2000  # a dead link is noticed after the lease; Zenoh's default of 10 s is long for an arm (measured in the design)
# What Zenoh itself may say, unless RUST_LOG is set. Its session reports samples that arrive while it closes as errors; they are none.
ZENOH_LOG = "error,zenoh::api::session=off"
QUEUE_LENGTH = 256
COMMAND_QUEUE_LENGTH = 64
log = logging.getLogger("bus")


class RemoteError(TolmanError):
    """A command was answered with an error reply, or by nobody."""

    code = "remote"


@dataclass(frozen=True)
class BusAddress:
    """Where the router is and under which prefix this robot cell lives."""

    endpoint: str = DEFAULT_ENDPOINT
    namespace: str = DEFAULT_NAMESPACE


def _config(mode: str, address: BusAddress) -> zenoh.Config:
    config = zenoh.Config()
    config.insert_json5("mode", json.dumps(mode))
    side = "listen" if mode == "router" else "connect"
    config.insert_json5(f"{side}/endpoints", json.dumps([address.endpoint]))
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("scouting/gossip/enabled", "false")
    config.insert_json5("transport/link/tx/lease", str(LEASE_MS))
    config.insert_json5("transport/shared_memory/enabled", "false")
    if mode != "router":
        config.insert_json5("namespace", json.dumps(address.namespace))
    return config


class Router:
    """A Zenoh router in this process (locally instead of a ``zenohd``)."""

    def __init__(self, endpoint: str = DEFAULT_ENDPOINT) -> None:
        zenoh.init_log_from_env_or(ZENOH_LOG)
        self.endpoint = endpoint
        try:
            self._session = zenoh.open(_config("router", BusAddress(endpoint)))
        except zenoh.ZError as error:
            raise RemoteError(f"cannot listen on {endpoint}: {error}", code="router", facts={"endpoint": endpoint}) from None

    def close(self) -> None:
        """Stop routing."""
        self._session.close()

    def __enter__(self) -> Router:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


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


class Bus:
    """One Zenoh session of one process, typed. Use it in ``with``: everything is undeclared and closed in order."""

    def __init__(self, address: BusAddress, *, connect_timeout_s: float = 10.0) -> None:
        zenoh.init_log_from_env_or(ZENOH_LOG)
        self.address = address
        self.epoch = utc_ns()
        self.wake = threading.Event()
        self.replies: deque[tuple[zenoh.Query, str, list[bytes], zenoh.Encoding]] = deque()
        self.counters: dict[str, int] = {}
        self._limit = RateLimit()
        self._tokens: list[zenoh.LivelinessToken] = []
        self._watchers: list[Any] = []
        self.session = self._open(connect_timeout_s)

    def _open(self, timeout_s: float) -> zenoh.Session:
        deadline = time.monotonic() + timeout_s
        while True:
            try:
                return zenoh.open(_config("client", self.address))
            except zenoh.ZError as error:  # a client's open fails without a router: retry with a deadline
                if time.monotonic() > deadline:
                    raise RemoteError(
                        f"no Zenoh router at {self.address.endpoint} within {timeout_s:g} s",
                        code="no_router",
                        facts={"endpoint": self.address.endpoint, "cause": str(error)},
                    ) from None
                time.sleep(0.05)

    def __enter__(self) -> Bus:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Take back the liveliness tokens first (others react at once), then end the session."""
        for token in self._tokens:
            with suppress(zenoh.ZError):
                token.undeclare()
        with suppress(zenoh.ZError):
            self.session.close()

    # --- state ---

    def latest(self, key: str, kind: type[M]) -> Latest[M]:
        """Newest-only inbox."""
        return Latest(self, key, kind)

    def queue(self, key: str, kind: type[M]) -> Queue[M]:
        """Inbox that keeps every sample."""
        return Queue(self, key, kind)

    def publisher(self, key: str, kind: type[M], *, history: int = 1) -> StatePublisher[M]:
        """Publisher of a state key."""
        return StatePublisher(self, key, kind, history=history)

    def get_state(self, key: str, kind: type[M], *, timeout_s: float = 1.0) -> list[M]:
        """Ask the publishers of a state key for what they sent last."""
        return [decode(payload, kind) for payload in self._query(key, b"", timeout_s)]

    # --- commands ---

    def commands(self, key: str, kind: type[M]) -> Commands[M]:
        """Serve a command key."""
        return Commands(self, key, kind)

    def request(self, key: str, message: Message, reply: type[R], *, timeout_s: float = 5.0) -> R:
        """Send a command and wait for its answer.

        Raises:
            RemoteError: an error reply (its code and facts are passed on), or nobody answered within the time.
        """
        answers = self._query(key, encode(message), timeout_s)
        if not answers:
            raise RemoteError(f"nobody answered {key} within {timeout_s:g} s", code="no_answer", facts={"key": key})
        return decode(answers[0], reply)

    def _query(self, key: str, payload: bytes, timeout_s: float) -> list[bytes]:
        answers = []
        # Zenoh's default would keep one reply a key, but a history is several replies on one key.
        replies = self.session.get(key, payload=payload or None, timeout=timeout_s, consolidation=zenoh.ConsolidationMode.NONE)
        for answer in replies:
            if answer.ok is not None:
                answers.append(bytes(answer.ok.payload))
                continue
            if answer.err is None:
                continue
            try:
                error = decode(bytes(answer.err.payload), ErrorReply)
            except WireError:
                continue  # Zenoh's own "timeout" error is plain text
            raise RemoteError(error.message, code=error.code, facts=error.facts)
        return answers

    def answer_gets(self) -> None:
        """Answer pending ``get`` on state keys; the service loop calls it each turn."""
        while self.replies:
            query, key, payloads, encoding = self.replies.popleft()
            with suppress(zenoh.ZError):
                for payload in payloads:
                    query.reply(key, payload, encoding=encoding)
                query.drop()

    # --- liveliness ---

    def declare_alive(self, owner: str) -> None:
        """Tell everybody that ``owner`` is ready; the token dies with the session."""
        self._tokens.append(self.session.liveliness().declare_token(keys.alive(owner)))

    def watch_alive(self, on_change: Callable[[str, bool], None]) -> None:
        """Call ``on_change(owner, alive)`` for each token that is there or comes and goes. Runs in Zenoh's thread: store and wake."""

        def on_sample(sample: zenoh.Sample) -> None:
            on_change(str(sample.key_expr).rsplit("/", 1)[-1], sample.kind == zenoh.SampleKind.PUT)
            self.wake.set()

        liveliness = self.session.liveliness()
        self._watchers.append(liveliness.declare_subscriber(keys.alive("*"), on_sample, history=True))

    def alive_owners(self, *, timeout_s: float = 1.0) -> list[str]:
        """Owners whose token is there now."""
        return sorted({str(r.ok.key_expr).rsplit("/", 1)[-1] for r in self._tokens_now(timeout_s) if r.ok is not None})

    def _tokens_now(self, timeout_s: float) -> Iterator[zenoh.Reply]:
        yield from self.session.liveliness().get(keys.alive("*"), timeout=timeout_s)

    # --- counting ---

    def count(self, name: str, n: int = 1) -> None:
        """Add to a health counter."""
        self.counters[name] = self.counters.get(name, 0) + n

    def complain(self, text: str, *, subject: str) -> None:
        """Count a bad payload and log it, rate-limited per subject."""
        self.count("bad_payloads")
        times = self._limit.allow(subject, monotonic_ns())
        if times:
            log.warning("bad payload (%d since last report): %s", times, text)
