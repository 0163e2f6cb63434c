"""The demo's figures from messages, and the arm's distances and speeds against independent ways to them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.provenance import provenance
from clients.demo.arm import Arm
from clients.demo.collect import SAMPLE_GAP_NS, Collector, percentiles
from clients.demo.driver import Tally
from clients.demo.moment import Moment, MomentKeeper
from clients.demo.picture import draw
from common.wire.messages import Clearance, GridInfo, PlannerEvent, PlannerStatus, RobotState, Trajectory, VoxelFrame
from tests.support.cell import ur3, ur3_cell

HOME = np.array(ur3_cell().robot.home_rad)
CLEAR = Clearance(
    min_distance_m=1.0, pair=[], contacts=3, contacts_caused=1, contacts_suffered=2, contact_pairs=[], tracking_error_max_rad=0.01
)


NEAR_TOOL_M: list[float] = ur3().tool_pose(HOME)[:3, 3].tolist()


@pytest.fixture(scope="module")
def arm() -> Arm:
    return Arm(ur3())


def state(n: int, mode: str, dq: np.ndarray) -> RobotState:
    return RobotState(
        stamp_ns=n * SAMPLE_GAP_NS,
        q_rad=HOME,
        dq_rad_s=dq,
        q_reference_rad=HOME,
        mode=mode,  # type: ignore[arg-type]
        reason="",
        trajectory_id="t",
        trajectory_time_s=0.08 * n,
        trajectory_accepted_ns=0,
    )


def status(reaction_ms: float | None, total_ms: float) -> PlannerStatus:
    return PlannerStatus(
        state="executing",
        reason="",
        rules="checked",
        model="gng",
        n_neurons=10,
        n_blocked=0,
        timing_ms={"total": total_ms},
        reaction_ms=reaction_ms,
        replans=0,
        accepted=0,
    )


def test_tool_speed_is_that_of_the_shoulder_turn(arm: Arm) -> None:
    dq = np.array([0.5, 0.0, 0.0, 0.0, 0.0, 0.0])
    radius_m = np.linalg.norm(arm.tool_positions(HOME[None])[0, :2])
    assert arm.tool_speeds(HOME[None], dq[None])[0] == pytest.approx(0.5 * radius_m, rel=1e-3)


def test_only_tracking_counts_for_the_median_speed(arm: Arm) -> None:
    collector = Collector()
    turning, still = np.array([0.5, 0.0, 0.0, 0.0, 0.0, 0.0]), np.zeros(6)
    for n in range(1, 30):
        collector.observe(state(n, "tracking" if n % 3 else "holding", turning if n % 3 else still))
    expected = arm.tool_speeds(HOME[None], turning[None])[0]
    assert collector.tool_speed_median_m_s(arm) == pytest.approx(expected)
    assert Collector().tool_speed_median_m_s(arm) is None


def test_a_repeated_status_is_one_measurement(arm: Arm) -> None:
    collector = Collector()
    for reaction_ms, total_ms in ((None, 1.0), (50.0, 2.0), (50.0, 2.0), (70.0, 3.0)):
        collector.observe(status(reaction_ms, total_ms))
    collector.observe_event(PlannerEvent(number=1, kind="replanned", facts={"rule": "blocked", "way": "map"}))
    collector.observe_event(PlannerEvent(number=2, kind="stopped", facts={}))
    figures = collector.figures(arm, Tally(reached_pick=3, reached_place=2), CLEAR, {}, {"robot/state": 125.0})
    assert figures["reaction_ms"]["n"] == 2
    assert figures["reaction_ms"]["p50"] == pytest.approx(60.0)
    assert figures["timing_ms"]["total"]["n"] == 3
    assert figures["replans"] == {"blocked": 1}
    assert (figures["stops"], figures["cycles"], figures["goals_reached"]) == (1, 2, 5)
    assert (figures["contacts_caused"], figures["contacts_suffered"]) == (1, 2)


def test_percentiles_of_nothing_are_none() -> None:
    assert percentiles([]) is None


def test_distance_to_a_box_bounds_that_of_the_meshes_from_below(arm: Arm) -> None:
    size_m, centre_m = [0.1, 0.2, 0.1], [0.5, 0.1, 0.2]
    frames = arm.model.joint_poses(HOME[None])[0]
    nearest = min(
        np.linalg.norm(
            np.maximum(
                np.abs(body.vertices @ frames[body.joint][:3, :3].T + frames[body.joint][:3, 3] - centre_m) - np.divide(size_m, 2), 0.0
            ),
            axis=1,
        ).min()
        for body in arm.model.bodies
    )
    found = arm.distance_to_box(HOME[None], size_m, centre_m)
    assert nearest - 0.02 < found <= nearest + 1e-9


def test_a_box_on_the_arms_way_is_not_fair(arm: Arm) -> None:
    tool_m = arm.tool_positions(HOME[None])[0]
    turning = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    angle = 0.45
    ahead_m = [tool_m[0] * np.cos(angle) - tool_m[1] * np.sin(angle), tool_m[0] * np.sin(angle) + tool_m[1] * np.cos(angle), tool_m[2]]
    size_m = [0.06, 0.06, 0.06]
    assert arm.distance_to_box(HOME[None], size_m, ahead_m) > 0.05
    assert arm.keeps_clear_of(HOME, turning, size_m, ahead_m, 0.5) <= 0.0
    assert arm.keeps_clear_of(HOME, -turning, size_m, ahead_m, 0.5) > 0.05


def test_the_keeper_wants_a_way_half_driven_with_cells_near_it(arm: Arm) -> None:
    keeper = MomentKeeper(arm)
    keeper.observe(voxels(3))
    keeper.observe(trajectory("t"))
    keeper.observe(state(1, "tracking", np.zeros(6)))
    assert keeper.best is None, "too little is driven yet"
    keeper.observe(state(5, "tracking", np.zeros(6)))
    assert keeper.best is not None
    assert len(keeper.best.cells_m) == 3
    assert len(keeper.best.driven_q_rad) == 2
    keeper.observe(voxels(2))
    keeper.observe(state(6, "tracking", np.zeros(6)))
    assert len(keeper.best.cells_m) == 3, "fewer cells are no better"
    keeper.observe(voxels(5))
    keeper.observe(state(7, "tracking", np.zeros(6)))
    assert len(keeper.best.cells_m) == 5
    keeper.observe(voxels(9))
    keeper.observe(state(9, "tracking", np.zeros(6)))
    assert len(keeper.best.cells_m) == 5, "too much is driven"


def voxels(n: int) -> VoxelFrame:
    grid = GridInfo(origin_m=NEAR_TOOL_M, shape=[10, 10, 10], resolution_m=0.02, fingerprint="")
    return VoxelFrame(grid=grid, cells=np.arange(n, dtype=np.int32), cameras=[], robot_seq=0, timing_ms={})


def trajectory(id: str) -> Trajectory:
    q_rad = np.stack([HOME, HOME + 0.5])
    return Trajectory(
        id=id, goal_id="g", kind="motion", start_ns=0, t_s=np.array([0.0, 1.0]), q_rad=q_rad, dq_rad_s=np.zeros((2, 6)), voxels_seq=0
    )


def test_the_picture_is_drawn(arm: Arm, tmp_path: Path) -> None:
    path = tmp_path / "scene" / "demo.png"
    moment = Moment(HOME, np.array([[0.4, 0.0, 0.2]]), 0.02, np.stack([HOME, HOME + 0.3]), np.stack([HOME]))
    draw(moment, arm, ur3_cell().static, path)
    assert path.read_bytes().startswith(b"\x89PNG")


def test_the_header_of_every_json() -> None:
    header = provenance(4, {"a": 1})
    assert {"machine", "commit", "seed", "config"} <= set(header)
    assert header["seed"] == 4
    assert header["machine"]["cores"] >= 1
