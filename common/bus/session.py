"""Sessions, router, requests, liveliness: one typed Zenoh session a process.

Every process is a client of one router. What comes in and goes out by key is in :mod:`common.bus.channels`.
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
from typing import Any, TypeVar

import zenoh

from common.bus.channels import Commands, Latest, Queue, StatePublisher
from common.clock import monotonic_ns, utc_ns
from common.errors import TolmanError, WireError
from common.log import RateLimit
from common.wire import keys
from common.wire.codec import decode, encode
from common.wire.messages import ErrorReply, Message

__all__ = [
    "DEFAULT_ENDPOINT",
    "DEFAULT_NAMESPACE",
    "Bus",
    "BusAddress",
    "RemoteError",
    "Router",
]

M = TypeVar("M", bound=Message)
R = TypeVar("R", bound=Message)

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"  # Zenoh's registered port
DEFAULT_NAMESPACE = "tolman"
LEASE_MS = 2000  # a dead link is noticed after the lease; Zenoh's default of 10 s is long for an arm (measured in the design)
# What Zenoh itself may say, unless RUST_LOG is set. Its session reports samples that arrive while it closes as errors; they are none.
ZENOH_LOG = "error,zenoh::api::session=off"
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
