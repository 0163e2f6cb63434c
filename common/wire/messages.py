"""Every message on the bus, one page. The contract in words is ``docs/protocol.md``; a test compares the two.

Fields may be added with a default, never renamed or reused. Arrays travel as ``{"dtype", "shape", "data"}``; in requests plain
lists of numbers are accepted too (:mod:`common.wire.codec`). Units are in the names; ``J`` = joints, ``K`` = knots, ``N`` = neurons,
``M`` = edges, ``C`` = cells. A field that may be absent has the type ``... | None``.
"""

from __future__ import annotations

from typing import Any, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
U16 = NDArray[np.uint16]
U8 = NDArray[np.uint8]

RobotMode = Literal["idle", "tracking", "holding", "stopping", "fault"]
PlannerState = Literal["idle", "planning", "executing", "blocked", "stale", "failed"]
Rules = Literal["checked", "paper"]
Search = Literal["dijkstra", "wavefront", "astar", "bidirectional"]
Outcome = Literal["path", "no_path", "start_blocked", "goal_blocked"]
Way = Literal["map", "repair", "fallback"]
ReplanRule = Literal["none", "blocked", "shorter"]
Shape = Literal["box", "sphere", "cylinder", "capsule", "mesh"]
ObstacleOp = Literal["add", "move", "script", "remove", "clear"]
GuideOp = Literal["start", "release"]
GraspOp = Literal["grasp", "release"]
MapPart = Literal["neurons", "edges", "blocked", "path", "tool_positions"]


class Message(msgspec.Struct, frozen=True, kw_only=True, eq=False, omit_defaults=False):
    """Base of all messages: immutable, encoded as a map of field names, unknown fields ignored, missing ones refused."""


class State(Message, frozen=True, kw_only=True, eq=False):
    """Base of published state. The publisher fills the header (:class:`common.bus.session.StatePublisher`)."""

    stamp_ns: int = 0
    epoch: int = 0
    seq: int = 0


class Empty(Message, frozen=True):
    """A command without arguments."""


class Ack(Message, frozen=True, kw_only=True):
    """A command was carried out."""

    ok: bool = True


class ErrorReply(Message, frozen=True, kw_only=True):
    """Payload of an error reply to any command."""

    code: str
    message: str
    facts: dict[str, Any]


# --- robot_sim ---------------------------------------------------------------------------------------------------------------


class HeldBox(Message, frozen=True, kw_only=True, eq=True):
    """A box in the gripper: full extents, and the pose of its middle in the tool frame; equal where the numbers are."""

    size_m: list[float]
    position_m: list[float] = msgspec.field(default_factory=lambda: [0.0, 0.0, 0.0])
    quaternion_xyzw: list[float] = msgspec.field(default_factory=lambda: [0.0, 0.0, 0.0, 1.0])


class Grasp(Message, frozen=True, kw_only=True, eq=False):
    """From now on the arm holds ``box`` (``grasp``), or nothing (``release``)."""

    op: GraspOp
    box: HeldBox | None = None


class RobotState(State, frozen=True, kw_only=True, eq=False):
    """What the arm does now; ``q_rad`` measured, ``q_reference_rad`` commanded. ``dq_reference_rad_s`` completes the splice state.

    ``trajectory_id`` is the newest accepted trajectory (empty: none since start or reset), ``trajectory_time_s`` how far along it the arm
    is: negative while it waits for its takeover, at most its duration; a braking arm stays on its path and stops at such a time.
    ``trajectory_refused_id`` is the newest one that was refused since the newest accepted one; empty: none.
    ``held``: what the gripper holds.
    """

    q_rad: F64
    dq_rad_s: F64
    q_reference_rad: F64
    mode: RobotMode
    reason: str
    trajectory_id: str
    trajectory_time_s: float
    trajectory_accepted_ns: int
    dq_reference_rad_s: F64 | None = None
    trajectory_refused_id: str = ""
    held: HeldBox | None = None


class Obstacle(Message, frozen=True, kw_only=True, eq=False):
    """A body of the scene. ``size_m``: box 3 full extents; sphere [radius]; cylinder, capsule [radius, length along z]."""

    id: str
    shape: Shape
    size_m: list[float]
    position_m: list[float]
    quaternion_xyzw: list[float] = msgspec.field(default_factory=lambda: [0.0, 0.0, 0.0, 1.0])
    velocity_m_s: list[float] = msgspec.field(default_factory=lambda: [0.0, 0.0, 0.0])
    mesh: str | None = None


class Scene(State, frozen=True, kw_only=True, eq=False):
    """Ground truth of the obstacles: for cameras, viewer, referees; perception and planner never read it."""

    obstacles: list[Obstacle]


class Waypoint(Message, frozen=True, kw_only=True):
    """One leg of an obstacle's scripted motion: go there at this speed, then rest."""

    position_m: list[float]
    quaternion_xyzw: list[float] | None = None
    speed_m_s: float = 0.25
    rest_s: float = 0.0


class SetObstacle(Message, frozen=True, kw_only=True, eq=False):
    """Add, move, script or remove an obstacle, or clear all."""

    op: ObstacleOp
    id: str = ""
    shape: Shape | None = None
    size_m: list[float] | None = None
    position_m: list[float] | None = None
    quaternion_xyzw: list[float] | None = None
    velocity_m_s: list[float] | None = None
    mesh: str | None = None
    script: list[Waypoint] | None = None
    loop: bool = False


class Clearance(Message, frozen=True, kw_only=True):
    """The physics engine's own word on distance and contacts (terms: ``docs/protocol.md``).

    ``min_distance_m`` and ``pair`` are of this moment, between the arm and anything but itself; the ``..._since_reset_m`` are the smallest
    since ``robot/reset``, of all looks (25 Hz) within their reach (0.3 m); absent when nothing came that near.
    """

    min_distance_m: float
    pair: list[str]
    contacts: int
    contacts_caused: int
    contacts_suffered: int
    contact_pairs: list[list[str]]
    min_obstacle_distance_m: float | None = None
    min_self_distance_m: float | None = None
    min_distance_since_reset_m: float | None = None
    min_obstacle_distance_since_reset_m: float | None = None
    tracking_error_max_rad: float = 0.0


class Guide(Message, frozen=True, kw_only=True):
    """A hand takes the tool where it is and drags it from waypoint to waypoint (``start``), or lets go (``release``)."""

    op: GuideOp
    waypoints: list[Waypoint] = []


class GuideReply(Message, frozen=True, kw_only=True):
    """The hand leads (or let go); ``guide_id`` is what ``robot/state`` shows as ``trajectory_id`` meanwhile, empty if none was led."""

    guide_id: str
    duration_s: float


class DepthImage(State, frozen=True, kw_only=True, eq=False):
    """One exposure of one camera; ``stamp_ns`` = exposure. ``depth_mm`` is the distance along the optical axis, 0 = no return."""

    camera: str
    width: int
    height: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    T_world_camera: F64
    depth_mm: U16
    published_ns: int


# --- perception --------------------------------------------------------------------------------------------------------------


class GridInfo(Message, frozen=True, kw_only=True):
    """Message ``Grid`` of the contract: the cell grid that flat indices refer to."""

    origin_m: list[float]
    shape: list[int]
    resolution_m: float
    fingerprint: str


class CameraUse(Message, frozen=True, kw_only=True):
    """Which exposure of a camera went into a frame, and whether it was used at all (late and missing ones are not)."""

    name: str
    seq: int
    exposure_ns: int
    used: bool
    published_ns: int = 0


class VoxelFrame(State, frozen=True, kw_only=True, eq=False):
    """Occupied cells: ascending flat indices, x slowest, z fastest. ``stamp_ns`` = newest exposure used."""

    grid: GridInfo
    cells: I32
    cameras: list[CameraUse]
    robot_seq: int
    timing_ms: dict[str, float]


# --- planner -----------------------------------------------------------------------------------------------------------------


class Trajectory(State, frozen=True, kw_only=True, eq=False):
    """A timed curve; between knots cubic Hermite (:mod:`common.robot.trajectory`). ``start_ns``: UTC instant of ``t_s = 0``.

    ``held``: with what in the gripper it was found free; the robot drives no motion that reckons with something else.
    """

    id: str
    goal_id: str
    kind: Literal["motion", "stop"]
    start_ns: int
    t_s: F64
    q_rad: F64
    dq_rad_s: F64
    splice_trajectory_id: str | None = None
    splice_time_s: float | None = None
    voxels_seq: int
    held: HeldBox | None = None


class PlannerStatus(State, frozen=True, kw_only=True, eq=False):
    """What the planner does and why.

    ``clearance_m``: distance from the arm, where it is told to be, to all that is seen and to the static layer; None while the eyes are
    stale. Never above the true one, as far as what is there is seen. ``held`` is the box that its plans reckon with.
    """

    state: PlannerState
    goal_id: str | None = None
    reason: str
    rule: ReplanRule | None = None
    way: Way | None = None
    refined: bool | None = None
    rules: Rules
    model: str
    n_neurons: int
    n_blocked: int
    path_length_rad: float | None = None
    path_neurons: int | None = None
    clearance_m: float | None = None
    timing_ms: dict[str, float]
    reaction_ms: float | None = None
    replans: int
    accepted: int
    held: HeldBox | None = None


class PlannerEvent(State, frozen=True, kw_only=True, eq=False):
    """Something happened; numbered from 1 per planner start. ``get`` answers the last 200, one reply each."""

    number: int
    kind: str
    goal_id: str | None = None
    facts: dict[str, Any]


class Pose(Message, frozen=True, kw_only=True):
    """Pose of the tool frame in the world."""

    position_m: list[float]
    quaternion_xyzw: list[float]


class SetGoal(Message, frozen=True, kw_only=True, eq=False):
    """Where to go: exactly one of joint vector, tool pose, or the name of a pose in the config."""

    q_rad: F64 | None = None
    pose: Pose | None = None
    name: str | None = None
    speed_scale: float | None = None
    constraint: str | None = None


class GoalAccepted(Message, frozen=True, kw_only=True):
    """The goal counts from now; it replaces the one before."""

    goal_id: str


class CancelGoal(Message, frozen=True, kw_only=True):
    """Give up the goal (the given one, or whichever is set)."""

    goal_id: str | None = None


class PlanRequest(Message, frozen=True, kw_only=True, eq=False):
    """A question: plan without moving anything. Absent fields mean: from here, on the live cells, as configured.

    ``refine``: wait some milliseconds more for a shorter path; absent: the first answer.
    """

    q_start_rad: F64 | None = None
    goal: SetGoal
    cells: I32 | None = None
    grid_fingerprint: str | None = None
    model: str | None = None
    search: Search | None = None
    rules: Rules | None = None
    smooth: bool | None = None
    ways: list[Way] | None = None
    refine: bool | None = None


class PlanReply(Message, frozen=True, kw_only=True, eq=False):
    """The answer; ``path_q_rad`` begins at the true start and ends at the true goal.

    ``refined``: the trajectory follows a shorter path than ``path_q_rad``, found in ``timing_ms`` refine after the first answer.
    """

    outcome: Outcome
    way: Way | None = None
    neurons: I32
    path_q_rad: F64
    smooth_q_rad: F64 | None = None
    trajectory: Trajectory | None = None
    length_rad: float
    timing_ms: dict[str, float]
    reason: str = ""
    refined: bool | None = None


class Demonstration(Message, frozen=True, kw_only=True, eq=False):
    """A joint path, taught or recorded, that shall join the map."""

    q_rad: F64
    t_s: F64 | None = None
    label: str | None = None


class LearnReply(Message, frozen=True, kw_only=True):
    """What the map gained."""

    n_neurons: int
    n_edges: int
    added_neurons: int
    added_edges: int
    seconds: float
    number: int | None = None


class MapQuery(Message, frozen=True, kw_only=True):
    """Ask for parts of the map, or for what one neuron or one cell means."""

    include: list[MapPart] = []
    neuron: int | None = None
    cell: int | None = None


class MapReply(Message, frozen=True, kw_only=True, eq=False):
    """Parts of the map as asked for."""

    q_rad: F64 | None = None
    tool_m: F64 | None = None
    edges: I32 | None = None
    blocked: U8 | None = None
    path: I32 | None = None
    cells: I32 | None = None
    neurons: I32 | None = None
    blocked_edges: I32 | None = None


# --- every service -----------------------------------------------------------------------------------------------------------


class ServiceInfo(Message, frozen=True, kw_only=True):
    """Who is there: build, process, config as loaded, fingerprints of what it works on."""

    owner: str
    version: str
    started_ns: int
    host: str
    pid: int
    config: dict[str, Any]
    fingerprints: dict[str, str]


class ServiceHealth(Message, frozen=True, kw_only=True):
    """How it fares."""

    ok: bool
    reasons: list[str]
    counters: dict[str, int]
    rates_hz: dict[str, float]
    latency_ms: dict[str, dict[str, float]]
