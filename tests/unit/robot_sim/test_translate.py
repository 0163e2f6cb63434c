from __future__ import annotations

import numpy as np
import pytest

from common.clock import ClockOffset
from common.errors import RequestError
from common.wire.messages import CameraUse, GridInfo, SetObstacle, Trajectory, VoxelFrame, Waypoint
from services.robot_sim.adapters.bullet import World
from services.robot_sim.core.obstacles import Obstacles
from services.robot_sim.translate import exposure_instant_ns, motion_of, obstacle_message, set_obstacle
from tests.support.cell import ur3

MS = 1_000_000
UTC = 1_700_000_000_000 * MS  # the sender's clock when ours says 0


def frame(*cameras: CameraUse) -> VoxelFrame:
    grid = GridInfo(origin_m=[0.0, 0.0, 0.0], shape=[1, 1, 1], resolution_m=0.1, fingerprint="")
    return VoxelFrame(grid=grid, cells=np.zeros(0, np.int32), cameras=list(cameras), robot_seq=1, timing_ms={})


def camera(exposure_ms: int, published_ms: int, used: bool = True) -> CameraUse:
    return CameraUse(name="front", seq=1, exposure_ns=UTC + exposure_ms * MS, used=used, published_ns=UTC + published_ms * MS)


def test_a_start_is_turned_once_into_our_clock() -> None:
    clock = ClockOffset()
    message = Trajectory(
        stamp_ns=UTC, id="a", goal_id="g", kind="stop", start_ns=UTC + 50 * MS, t_s=np.zeros(1), q_rad=np.zeros((1, 6)),
        dq_rad_s=np.zeros((1, 6)), splice_trajectory_id="b", splice_time_s=0.5, voxels_seq=1,
    )  # fmt: skip
    motion = motion_of(message, clock, arrival_ns=1 * MS)
    assert motion.start_ns == 51 * MS  # 1 ms on the way
    assert (motion.id, motion.kind, motion.splice_id, motion.splice_time_s) == ("a", "stop", "b", 0.5)


def test_exposures_count_on_our_clock_and_only_if_used() -> None:
    clock = ClockOffset()
    assert exposure_instant_ns(frame(camera(0, 20, used=False)), clock, 30 * MS) is None
    assert exposure_instant_ns(frame(), clock, 30 * MS) is None
    for k in range(5):  # each 20 ms from exposure to publication, 10 ms from there to us
        at = 100 * k
        assert exposure_instant_ns(frame(camera(at - 30, at), camera(at - 20, at)), clock, (at + 10) * MS) == (at - 10) * MS
    # The picture freezes while frames go on: the exposure stays where it was and grows old.
    assert exposure_instant_ns(frame(camera(380, 400)), clock, 800 * MS) == 390 * MS


def test_exposures_of_the_future_are_of_now() -> None:
    assert exposure_instant_ns(frame(camera(5000, 0)), ClockOffset(), 10 * MS) == 10 * MS


def test_a_refused_script_leaves_no_obstacle_behind() -> None:
    obstacles = Obstacles(8)
    add = {"op": "add", "id": "hand", "shape": "capsule", "size_m": [0.04, 0.3], "position_m": [0.5, 0.5, 0.5]}
    with World(ur3(), [], 0.004) as world:
        with pytest.raises(RequestError, match="speed_m_s"):
            set_obstacle(SetObstacle(**add, script=[Waypoint(position_m=[0, 0, 1], speed_m_s=-1.0)]), obstacles, world)
        assert obstacles.all() == [] and world.nearest_obstacle(3.0) is None
        set_obstacle(SetObstacle(**add), obstacles, world)
        set_obstacle(SetObstacle(op="move", id="hand", quaternion_xyzw=[0.0, 0.0, 0.0, 2.0]), obstacles, world)
        shown = obstacle_message(obstacles.all()[0])
        assert (shown.position_m, shown.quaternion_xyzw, shown.size_m) == ([0.5, 0.5, 0.5], [0.0, 0.0, 0.0, 1.0], [0.04, 0.3])
        with pytest.raises(RequestError, match="move needs"):
            set_obstacle(SetObstacle(op="move", id="hand"), obstacles, world)
        set_obstacle(SetObstacle(op="clear"), obstacles, world)
        assert obstacles.all() == [] and world.nearest_obstacle(3.0) is None
