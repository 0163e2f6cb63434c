"""The whole stack as real processes around a real router, with the shipped map, built once and kept between tests."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from clients.stack import OwnStack, free_endpoint
from common.bus.session import Bus, BusAddress
from common.wire.messages import Ack, Empty, SetObstacle
from deploy.processes import StackOptions
from tests.support.shipped_map import build_shipped_map

READY_WITHIN_S = 240.0  # the first start compiles kernels


@pytest.fixture(scope="session")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[OwnStack]:
    """A running stack on a port and in a namespace of its own; shared by all tests that leave it as they found it."""
    build_shipped_map()
    options = StackOptions(BusAddress(free_endpoint(), "integration"), overrides=("planner.learning.keep=false",))  # tests leave no trace
    running = OwnStack(options)
    try:
        with running.connect() as bus:
            running.wait_ready(bus, READY_WITHIN_S)
        yield running
    finally:
        running.stop()


@pytest.fixture
def bus(stack: OwnStack) -> Iterator[Bus]:
    """A client of the running stack; the scene is empty and the arm at home when a test begins."""
    with Bus(stack.address) as client:
        client.request("planner/cancel", Empty(), Ack)
        client.request("robot/obstacle", SetObstacle(op="clear"), Ack)
        client.request("robot/resume", Empty(), Ack)
        client.request("robot/reset", Empty(), Ack)
        yield client
