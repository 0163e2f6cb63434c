"""Between the wire's messages and the core's values."""

from __future__ import annotations

import math

from common.clock import ClockOffset
from common.errors import RequestError
from common.wire.messages import Clearance, Guide, Obstacle, SetObstacle, Trajectory, VoxelFrame
from services.robot_sim.adapters.bullet import World
from services.robot_sim.adapters.bullet_monitor import Monitor
from services.robot_sim.core.admission import Motion
from services.robot_sim.core.hand import HandPoint
from services.robot_sim.core.obstacles import Obstacles, Thing, Waypoint, pose_of

__all__ = ["clearance_message", "exposure_instant_ns", "hand_points", "motion_of", "obstacle_message", "set_obstacle"]


def motion_of(message: Trajectory, planner_clock: ClockOffset, arrival_ns: int) -> Motion:
    """A trajectory with its start on this machine's monotonic clock."""
    planner_clock.observe(message.stamp_ns, arrival_ns)
    return Motion(
        id=message.id,
        kind=message.kind,
        start_ns=planner_clock.to_monotonic(message.start_ns),
        t_s=message.t_s,
        q_rad=message.q_rad,
        dq_rad_s=message.dq_rad_s,
        splice_id=message.splice_trajectory_id,
        splice_time_s=message.splice_time_s,
    )


def exposure_instant_ns(message: VoxelFrame, cameras_clock: ClockOffset, arrival_ns: int) -> int | None:
    """Monotonic instant of the newest exposure that went into a frame; None if none did.

    The cameras' clock is known through their images' ``published_ns``, which reach this service by way of perception: the least delay
    of that way (some 10 ms) counts as part of the offset.
    """
    used = [camera for camera in message.cameras if camera.used]
    if not used:
        return None
    newest = max(used, key=lambda camera: camera.exposure_ns)
    cameras_clock.observe(max(newest.published_ns, newest.exposure_ns), arrival_ns)
    return min(cameras_clock.to_monotonic(newest.exposure_ns), arrival_ns)


def obstacle_message(thing: Thing) -> Obstacle:
    """An obstacle as ``robot/scene`` shows it."""
    return Obstacle(
        id=thing.id,
        shape=thing.shape,
        size_m=list(thing.size_m),
        position_m=thing.pose.position_m.tolist(),
        quaternion_xyzw=thing.pose.quaternion_xyzw.tolist(),
        velocity_m_s=thing.velocity_m_s.tolist(),
    )


def set_obstacle(request: SetObstacle, obstacles: Obstacles, world: World) -> None:
    """Carry out ``robot/obstacle`` in the book of obstacles and in the world.

    Raises:
        RequestError: what cannot be done; nothing was changed then.
    """
    if request.op == "clear":
        for thing in obstacles.all():
            world.remove(thing.id)
        obstacles.clear()
    elif request.op == "remove":
        obstacles.remove(request.id)
        world.remove(request.id)
    elif request.op == "add":
        _add(request, obstacles, world)
    elif request.op == "move":
        _move(request, obstacles, world)
    else:
        obstacles.script(request.id, _waypoints(request), request.loop)


def _add(request: SetObstacle, obstacles: Obstacles, world: World) -> None:
    pose = pose_of(request.position_m, request.quaternion_xyzw, f"obstacle {request.id!r}")
    thing = obstacles.add(request.id, request.shape, request.size_m, pose, request.velocity_m_s)
    if request.script is not None:
        try:
            obstacles.script(request.id, _waypoints(request), request.loop)
        except RequestError:
            obstacles.remove(request.id)
            raise
    world.add(thing)


def _move(request: SetObstacle, obstacles: Obstacles, world: World) -> None:
    known = obstacles.get(request.id).pose
    if request.position_m is None and request.quaternion_xyzw is None and request.velocity_m_s is None:
        raise RequestError(f"obstacle {request.id!r}: move needs position_m, quaternion_xyzw or velocity_m_s", facts={"id": request.id})
    position = known.position_m.tolist() if request.position_m is None else request.position_m
    quaternion = known.quaternion_xyzw.tolist() if request.quaternion_xyzw is None else request.quaternion_xyzw
    pose = pose_of(position, quaternion, f"obstacle {request.id!r}")
    world.place(request.id, obstacles.move(request.id, pose, request.velocity_m_s).pose)


def _waypoints(request: SetObstacle) -> list[Waypoint]:
    return [Waypoint(w.position_m, w.quaternion_xyzw, w.speed_m_s, w.rest_s) for w in request.script or []]


def hand_points(request: Guide) -> list[HandPoint]:
    """The waypoints of a guiding hand."""
    return [HandPoint(w.position_m, w.quaternion_xyzw, w.speed_m_s, w.rest_s) for w in request.waypoints]


def clearance_message(monitor: Monitor) -> Clearance:
    """What ``robot/clearance`` answers."""
    snapshot = monitor.look()
    world, log = snapshot.world, monitor.contacts
    return Clearance(
        min_distance_m=math.inf if world is None else world.distance_m,
        pair=[] if world is None else [world.part, world.other],
        contacts=log.caused + log.suffered,
        contacts_caused=log.caused,
        contacts_suffered=log.suffered,
        contact_pairs=[list(pair) for pair in log.pairs],
        min_obstacle_distance_m=None if snapshot.obstacle is None else snapshot.obstacle.distance_m,
        min_self_distance_m=None if snapshot.own is None else snapshot.own.distance_m,
        min_distance_since_reset_m=monitor.min_world_m,
        min_obstacle_distance_since_reset_m=monitor.min_obstacle_m,
        tracking_error_max_rad=monitor.tracking_error_max_rad,
    )
