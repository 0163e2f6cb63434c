"""The key table of the wire contract (``docs/protocol.md``, section Keys).

Grammar: ``<owner>/<noun>[/<instance>]``; the first chunk is the only writer. The deployment prefix is the session's Zenoh
namespace and is never spelled here. A test compares this table with the documentation.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from common.wire import messages as m

__all__ = ["CHANNELS", "Channel", "Kind", "alive", "camera_depth", "channel", "health", "info"]


class Kind(Enum):
    """How a key is spoken: published state that also answers ``get``, or a command that is a query."""

    STATE = "state"
    COMMAND = "command"


@dataclass(frozen=True)
class Channel:
    """One row of the key table.

    Attributes:
        key: the key expression without namespace; ``*`` stands for an instance.
        kind: state or command.
        message: the published message, or the request.
        reply: what a command answers; None for a state.
        rate_hz: nominal rate of a state that is published periodically, else None.
        lossless: True when a sample may never be dropped (congestion control "block", queueing inboxes).
    """

    key: str
    kind: Kind
    message: type[m.Message]
    reply: type[m.Message] | None = None
    rate_hz: float | None = None
    lossless: bool = False


OWNERS = ("robot", "cameras", "perception", "planner")

CHANNELS: tuple[Channel, ...] = (
    Channel("robot/state", Kind.STATE, m.RobotState, rate_hz=125.0),
    Channel("robot/scene", Kind.STATE, m.Scene, rate_hz=30.0),
    Channel("camera/*/depth", Kind.STATE, m.DepthImage, rate_hz=15.0),
    Channel("perception/voxels", Kind.STATE, m.VoxelFrame, rate_hz=15.0),
    Channel("planner/trajectory", Kind.STATE, m.Trajectory, lossless=True),
    Channel("planner/status", Kind.STATE, m.PlannerStatus, rate_hz=10.0),
    Channel("planner/event", Kind.STATE, m.PlannerEvent, lossless=True),
    Channel("planner/goal", Kind.COMMAND, m.SetGoal, m.GoalAccepted),
    Channel("planner/cancel", Kind.COMMAND, m.CancelGoal, m.Ack),
    Channel("planner/plan", Kind.COMMAND, m.PlanRequest, m.PlanReply),
    Channel("planner/learn", Kind.COMMAND, m.Demonstration, m.LearnReply),
    Channel("planner/map", Kind.COMMAND, m.MapQuery, m.MapReply),
    Channel("robot/obstacle", Kind.COMMAND, m.SetObstacle, m.Ack),
    Channel("robot/guide", Kind.COMMAND, m.Guide, m.GuideReply),
    Channel("robot/grasp", Kind.COMMAND, m.Grasp, m.Ack),
    Channel("robot/stop", Kind.COMMAND, m.Empty, m.Ack),
    Channel("robot/resume", Kind.COMMAND, m.Empty, m.Ack),
    Channel("robot/reset", Kind.COMMAND, m.Empty, m.Ack),
    Channel("robot/clearance", Kind.COMMAND, m.Empty, m.Clearance),
    Channel("*/info", Kind.COMMAND, m.Empty, m.ServiceInfo),
    Channel("*/health", Kind.COMMAND, m.Empty, m.ServiceHealth),
)

_BY_KEY = {c.key: c for c in CHANNELS}


def channel(key: str) -> Channel:
    """The row of a concrete key such as ``camera/front_left/depth``.

    Raises:
        KeyError: when no row describes it.
    """
    if key in _BY_KEY:
        return _BY_KEY[key]
    chunks = key.split("/")
    if len(chunks) == 3 and chunks[0] == "camera":
        return _BY_KEY[f"camera/*/{chunks[2]}"]
    return _BY_KEY[f"*/{chunks[-1]}"]


def camera_depth(name: str) -> str:
    """Key of one camera's depth images."""
    return f"camera/{name}/depth"


def info(owner: str) -> str:
    """Key that answers :class:`~common.wire.messages.ServiceInfo`."""
    return f"{owner}/info"


def health(owner: str) -> str:
    """Key that answers :class:`~common.wire.messages.ServiceHealth`."""
    return f"{owner}/health"


def alive(owner: str) -> str:
    """Liveliness token of a service; it exists from readiness to the end of the session."""
    return f"@alive/{owner}"
