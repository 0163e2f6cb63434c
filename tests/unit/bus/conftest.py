from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest

from clients.stack import free_endpoint
from common.bus.session import Bus, BusAddress, Router


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    """A real router of its own."""
    with Router(free_endpoint()) as router:
        yield router.endpoint


@pytest.fixture
def join(endpoint: str, request: pytest.FixtureRequest) -> Iterator[Callable[[], Bus]]:
    """Opens sessions in a namespace of this test alone."""
    with ExitStack() as stack:
        yield lambda: stack.enter_context(Bus(BusAddress(endpoint, request.node.name.replace("[", "_").replace("]", ""))))
