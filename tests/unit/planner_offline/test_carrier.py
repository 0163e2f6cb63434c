"""The planner gets ready for what the gripper holds, exchanges everything at once, and back."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import numpy as np
import pytest

from common.clock import monotonic_ns
from common.robot.payload import PAYLOAD, Payload
from services.planner.assemble import Parts
from services.planner.carrier import Carrier, Ready
from services.planner.config import PlannerConfig
from services.planner.core.lookup import BlockedCounts
from services.planner.core.reflex import Reflex
from services.planner.core.roadmap import Roadmap
from services.planner.offline import build
from services.planner.offline.build import Job
from tests.support.cell import ur3_cell

BOX = Payload((0.05, 0.05, 0.10), (0.0, 0.0, 0.05))


@pytest.fixture(scope="module")
def parts(small: PlannerConfig, scene, tmp_path_factory: pytest.TempPathFactory) -> Parts:
    built = build.run(Job.of(ur3_cell(), small, cache=tmp_path_factory.mktemp("carrier")))[0]
    return Parts(ur3_cell(), small, scene.robot, scene.grid, Roadmap.of(built.learned, built.table, "gng"), built)


class Waiting:
    """A carrier, and what it prepared."""

    def __init__(self, reflex: Reflex) -> None:
        self._woken = threading.Event()
        self.carrier = Carrier(reflex, self._woken.set)

    def ready_for(self, parts: Parts, payload: Payload | None) -> Ready:
        self.carrier.want(parts, payload)
        while True:
            assert self._woken.wait(120.0)
            self._woken.clear()
            ready = self.carrier.take()
            if ready is not None:
                assert ready.payload == payload
                return ready


@pytest.fixture
def reflex(parts: Parts) -> Reflex:
    return parts.reflex(monotonic_ns, "test")


@pytest.fixture
def waiting(reflex: Reflex) -> Iterator[Waiting]:
    one = Waiting(reflex)
    yield one
    one.carrier.close()


def test_all_that_plans_is_exchanged_and_counts_the_live_cells(parts: Parts, reflex: Reflex, waiting: Waiting) -> None:
    ready = waiting.ready_for(parts, BOX)
    assert ready.parts is not None and ready.parts.held == BOX
    held = ready.parts.roadmap
    assert np.array_equal(held.edges, parts.roadmap.edges) and np.array_equal(held.neurons_rad, parts.roadmap.neurons_rad)
    cells = np.flatnonzero(np.diff(held.table.node_offset))[::40].astype(np.int32)
    reflex.see(0.0, 0.0, cells, 1, 0)  # a frame that came while the table was made
    ready.adopt(reflex)
    assert reflex.checker is reflex.planner.checker is ready.planner.checker  # type: ignore[union-attr]
    fresh = BlockedCounts(held.table, held.n_neurons, held.n_edges)
    fresh.set_cells(cells)
    assert np.array_equal(reflex.vision.counts.node, fresh.node) and np.array_equal(reflex.vision.counts.edge, fresh.edge)
    assert reflex.vision.counts.n_blocked > 0
    bare = waiting.ready_for(parts, None)
    bare.adopt(reflex)
    assert bare.parts is parts and PAYLOAD not in [body.name for body in bare.parts.robot.bodies]
    assert reflex.planner.finder.roadmap is parts.roadmap


def test_the_same_box_again_is_there_at_once(parts: Parts, waiting: Waiting) -> None:
    first, again = waiting.ready_for(parts, BOX), waiting.ready_for(parts, BOX)
    assert again.parts is first.parts
    other = waiting.ready_for(parts, Payload((0.05, 0.05, 0.11)))
    assert other.parts is not None and other.parts.robot.fingerprint != first.parts.robot.fingerprint  # type: ignore[union-attr]


def test_a_box_that_cannot_be_held_is_told_and_nothing_is_exchanged(parts: Parts, reflex: Reflex, waiting: Waiting) -> None:
    planner = reflex.planner
    ready = waiting.ready_for(parts, Payload((0.2, 0.2, 0.2), (0.0, 0.0, -0.15)))
    assert "the box is in" in ready.problem and ready.parts is None
    ready.adopt(reflex)
    assert reflex.planner is planner
