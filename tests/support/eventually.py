"""The one place in the tests that waits: poll a condition until it holds or the time is over."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


def eventually(predicate: Callable[[], T], timeout_s: float = 10.0, what: str = "the condition") -> T:
    """The first truthy value of ``predicate``; AssertionError when ``timeout_s`` passes without one."""
    deadline = time.monotonic() + timeout_s
    while True:
        value = predicate()
        if value:
            return value
        if time.monotonic() > deadline:
            raise AssertionError(f"{what} did not hold within {timeout_s:g} s (last value: {value!r})")
        time.sleep(0.01)
