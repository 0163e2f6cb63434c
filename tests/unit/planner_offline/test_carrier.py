"""The planner gets ready for what the gripper holds, exchanges everything at once, and back."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import numpy as np
import pytest

from common.clock import monotonic_ns
from common.robot.payload import PAYLOAD, Payload
from services.planner import carrier
from services.planner.assemble import Parts, parts_of
from services.planner.carrier import Carrier, Ready
from services.planner.config import PlannerConfig
from services.planner.core.growth import Addition, grown
from services.planner.core.lookup import BlockedCounts
from services.planner.core.reflex import Reflex
from services.planner.core.world import cells_of
from services.planner.kernels.cells import Cells
from services.planner.offline import build
from services.planner.offline.build import Job
from tests.support.cell import ur3_cell

BOX = Payload((0.05, 0.05, 0.10), (0.0, 0.0, 0.05))


@pytest.fixture(scope="module")
def parts(small: PlannerConfig, tmp_path_factory: pytest.TempPathFactory) -> Parts:
    job = Job.of(ur3_cell(), small, cache=tmp_path_factory.mktemp("carrier"))
    built = build.run(job)[0]
    return parts_of(job, built)


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
    before_m = reflex.checker.clearance(_below_the_box(parts), parts.robot.home_rad)
    ready.adopt(reflex)
    assert reflex.checker is reflex.planner.checker is ready.planner.checker  # type: ignore[union-attr]
    assert reflex.checker.clearance(_below_the_box(parts), parts.robot.home_rad) < before_m - 0.05
    assert ready.parts.separation is not None and len(ready.parts.separation.arm.moving) == len(parts.arm.moving) + 1
    assert len(ready.parts.separation.reach.shape) == len(parts.arm.moving) + 1
    fresh = BlockedCounts(held.table, held.n_neurons, held.n_edges)
    fresh.set_cells(cells)
    assert np.array_equal(reflex.vision.counts.node, fresh.node) and np.array_equal(reflex.vision.counts.edge, fresh.edge)
    assert np.array_equal(reflex.vision.counts.near.node, fresh.near.node) and (fresh.near.node == 0).any()
    assert reflex.vision.counts.n_blocked > 0
    bare = waiting.ready_for(parts, None)
    bare.adopt(reflex)
    assert bare.parts is parts and PAYLOAD not in [body.name for body in bare.parts.robot.bodies]
    assert reflex.planner.finder.roadmap is parts.roadmap


def _below_the_box(parts: Parts) -> Cells:
    """The cell of a point 15 cm beyond the tool's centre: 5 cm beyond the box."""
    point = (parts.robot.tool_pose(parts.robot.home_rad) @ [0.0, 0.0, 0.15, 1.0])[:3]
    return cells_of(
        parts.grid, np.array([np.argmin(np.linalg.norm(parts.grid.centres(np.arange(parts.grid.n_cells)) - point, axis=1))], np.int32)
    )


def test_the_same_box_again_is_kept_and_few_are(parts: Parts, waiting: Waiting, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(carrier, "KEPT", 1)
    boxes = (BOX, BOX, Payload((0.05, 0.05, 0.11)), BOX)
    first, again, other, anew = (waiting.ready_for(parts, box).parts for box in boxes)
    assert first is not None and again is not None and other is not None and anew is not None
    assert again.robot is first.robot and other.robot.fingerprint != first.robot.fingerprint
    assert anew.robot is not first.robot and anew.robot.fingerprint == first.robot.fingerprint
    for table in (again.roadmap.table, anew.roadmap.table):
        assert table.node_owner.tobytes() == first.roadmap.table.node_owner.tobytes()


def test_what_was_learned_meanwhile_is_in_the_map_of_the_box(parts: Parts, waiting: Waiting) -> None:
    first = waiting.ready_for(parts, BOX).parts
    n = parts.roadmap.n_neurons
    middle = parts.roadmap.neurons_rad[parts.roadmap.edges[0]].mean(axis=0)
    ends = np.array([[parts.roadmap.edges[0, 0], n], [parts.roadmap.edges[0, 1], n]], dtype=np.int32)
    larger = parts.on(grown(parts.roadmap, Addition(middle[None], ends), parts.ground))
    ready = waiting.ready_for(larger, BOX).parts
    assert first is not None and ready is not None and ready.robot is first.robot and ready.roadmap.n_neurons == n + 1
    anew = larger.holding(larger.load(BOX)).roadmap.table
    for name in ("node_offset", "node_owner", "edge_offset", "edge_owner", "barred_nodes", "barred_edges", "unavoidable"):
        assert np.array_equal(getattr(ready.roadmap.table, name), getattr(anew, name)), name


def test_a_box_that_cannot_be_held_is_told_and_nothing_is_exchanged(parts: Parts, reflex: Reflex, waiting: Waiting) -> None:
    planner = reflex.planner
    ready = waiting.ready_for(parts, Payload((0.2, 0.2, 0.2), (0.0, 0.0, -0.15)))
    assert "the box is in" in ready.problem and ready.parts is None
    ready.adopt(reflex)
    assert reflex.planner is planner
