from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np

from benchmarks.paper.claims.bit_table import BitTable
from benchmarks.paper.figures.dodge_record import Dodge, Recorder, read_dodge, write_dodge
from benchmarks.paper.figures.layout import lay_out, mean_edge_px
from clients.demo.moment import Moment
from common.wire.messages import GridInfo, RobotState, Trajectory, VoxelFrame
from services.planner.core.cognitive_map import CognitiveMap
from services.planner.core.lookup import BlockedCounts, LookupTable
from services.planner.core.roadmap import Roadmap


def small_table(n_neurons: int, n_cells: int, rng: np.random.Generator) -> LookupTable:
    hit = rng.random((n_cells, n_neurons)) < 0.1
    offset = np.concatenate([[0], np.cumsum(hit.sum(axis=1))]).astype(np.int64)[None]
    owner = np.nonzero(hit)[1].astype(np.uint16)
    empty = np.zeros((1, n_cells + 1), dtype=np.int64)
    return LookupTable(offset, owner, empty, np.empty(0, dtype=np.uint16), np.empty(0, dtype=np.int32))


def test_bits_block_what_lists_block() -> None:
    rng = np.random.default_rng(0)
    n_neurons, n_cells = 131, 57  # no multiples of a word
    table = small_table(n_neurons, n_cells, rng)
    bits, counts = BitTable.of(table, n_neurons), BlockedCounts(table, n_neurons, 0)
    for _ in range(20):
        cells = np.flatnonzero(rng.random(n_cells) < 0.1).astype(np.int32)
        counts.set_cells(cells)
        assert np.array_equal(bits.blocked(cells), counts.node > 0)


def lattice(side: int) -> Roadmap:
    unit = np.arange(side * side).reshape(side, side)
    edges = np.concatenate([np.stack([unit[:, :-1].ravel(), unit[:, 1:].ravel()], 1), np.stack([unit[:-1].ravel(), unit[1:].ravel()], 1)])
    shuffled = np.random.default_rng(1).permutation(side * side)
    where = np.stack(np.unravel_index(np.argsort(shuffled), (side, side)), axis=1).astype(np.float64)
    learned = CognitiveMap.of(where, shuffled[edges])
    table = small_table(side * side, 3, np.random.default_rng(2))
    return Roadmap.of(learned, table, "gng")


def test_a_layout_uses_each_place_once_and_keeps_neighbours_near() -> None:
    roadmap = lattice(12)
    place = lay_out(roadmap, 12)
    assert len(np.unique(place, axis=0)) == 144
    at_random = np.stack(np.unravel_index(np.random.default_rng(0).permutation(144), (12, 12)), axis=1).astype(np.int32)
    assert mean_edge_px(roadmap, place) < 0.4 * mean_edge_px(roadmap, at_random)
    assert np.array_equal(place, lay_out(roadmap, 12))


HEADER = {"epoch": "e", "seq": 1}
NOW_NS = 1_764_000_000_000_000_000  # as large as stamps are: floats would round them
GRID = GridInfo(origin_m=[0.0, 0.0, 0.0], shape=[10, 10, 10], resolution_m=0.1, fingerprint="f")


def way(name: str, bend: float, stamp_ns: int, splice_s: float | None) -> Trajectory:
    q = np.array([[0.0, 0.0], [0.5, bend], [1.0, 0.0]])
    return Trajectory(
        **HEADER, stamp_ns=stamp_ns, id=name, goal_id="g", kind="motion", start_ns=stamp_ns, t_s=np.array([0.0, 1.0, 2.0]), q_rad=q,
        dq_rad_s=np.zeros_like(q), splice_time_s=splice_s, voxels_seq=1,
    )  # fmt: skip


def recorded(bend: float, splice_s: float | None) -> Dodge | None:
    arm = SimpleNamespace(tool_positions=lambda q: np.column_stack([q, np.zeros(len(q))]))
    recorder = Recorder(arm)  # type: ignore[arg-type]
    recorder.observe(
        VoxelFrame(**HEADER, stamp_ns=NOW_NS, grid=GRID, cells=np.arange(50, dtype=np.int32), cameras=[], robot_seq=1, timing_ms={})
    )
    for trajectory in (way("a", 0.0, NOW_NS, None), way("b", bend, NOW_NS + 1_000_000_007, splice_s)):
        recorder.observe(trajectory)
        for k in range(12):
            stamp_ns = trajectory.stamp_ns + 80_000_000 * k
            state = RobotState(
                **HEADER, stamp_ns=stamp_ns, q_rad=np.array([k / 12.0, 0.0]), dq_rad_s=np.zeros(2), q_reference_rad=np.zeros(2),
                mode="tracking", reason="", trajectory_id=trajectory.id, trajectory_time_s=0.0, trajectory_accepted_ns=0,
            )  # fmt: skip
            recorder.observe(state)
    return recorder.best()


def test_a_dodge_is_a_new_way_taken_in_motion_that_bends() -> None:
    found = recorded(0.3, splice_s=0.5)
    assert found is not None
    assert found.at_s[0] < 0.0 == found.at_s[1] < found.at_s[-1]
    assert np.array_equal(found.photos[1].planned_q_rad[0], [0.0, 0.0])
    assert found.photos[1].planned_q_rad[:, 1].max() > 0.2  # the new way is there from its first moment on
    assert found.photos[0].planned_q_rad[:, 1].max() == 0.0
    assert all(a < b for a, b in zip(found.at_s[:-1], found.at_s[1:], strict=True))
    assert len(found.photos[-1].driven_q_rad) > len(found.photos[0].driven_q_rad)
    assert recorded(0.01, splice_s=0.5) is None  # hardly bends
    assert recorded(0.3, splice_s=None) is None  # taken at rest


def test_a_recorded_dodge_is_read_back(tmp_path: Path) -> None:
    photo = Moment(np.arange(6.0), np.ones((3, 3)), 0.02, np.zeros((4, 6)), np.ones((5, 6)))
    write_dodge(Dodge((-0.2, 0.5), (photo, photo), 0.12), tmp_path / "d.npz")
    again = read_dodge(tmp_path / "d.npz")
    assert again.at_s == (-0.2, 0.5)
    assert again.bend_m == 0.12
    assert np.array_equal(again.photos[1].driven_q_rad, photo.driven_q_rad)
