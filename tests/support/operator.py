"""What an operator does with a running stack: put boxes, send goals, watch what becomes of them."""

from __future__ import annotations

from collections.abc import Callable

from clients.waiting import wait_until
from common.bus.session import Bus
from common.wire.messages import (
    Ack,
    Clearance,
    Empty,
    GoalAccepted,
    PlannerEvent,
    PlannerStatus,
    Pose,
    RobotState,
    SetGoal,
    SetObstacle,
    VoxelFrame,
)

__all__ = ["OVER_PICK", "OVER_PLACE", "Operator"]

TOOL_DOWN = [1.0, 0.0, 0.0, 0.0]
OVER_PICK = Pose(position_m=[0.32, -0.30, 0.20], quaternion_xyzw=TOOL_DOWN)
OVER_PLACE = Pose(position_m=[0.32, 0.30, 0.20], quaternion_xyzw=TOOL_DOWN)


class Operator:
    """One client with its eyes on events, status, robot and cells."""

    def __init__(self, bus: Bus) -> None:
        self.bus = bus
        self.events: list[PlannerEvent] = []
        self.status: PlannerStatus | None = None
        self.robot: RobotState | None = None
        self.voxels: VoxelFrame | None = None
        self._events = bus.queue("planner/event", PlannerEvent)
        self._status = bus.latest("planner/status", PlannerStatus)
        self._robot = bus.latest("robot/state", RobotState)
        self._voxels = bus.latest("perception/voxels", VoxelFrame)

    def look(self) -> None:
        """Take what came in."""
        self.events += [received.message for received in self._events.take_all()]
        for name in ("status", "robot", "voxels"):
            received = getattr(self, f"_{name}").take()
            if received is not None:
                setattr(self, name, received.message)

    def until(self, condition: Callable[[], bool], what: str, timeout_s: float = 30.0) -> None:
        """Look until the condition holds; AssertionError with the last status otherwise."""

        def holds() -> bool:
            self.look()
            return condition()

        assert wait_until(self.bus, holds, timeout_s), f"{what} did not come true; last status: {self.status}; robot: {self.robot}"

    def box(self, name: str, position_m: list[float], size_m: list[float]) -> None:
        """Put a box there."""
        self.bus.request("robot/obstacle", SetObstacle(op="add", id=name, shape="box", size_m=size_m, position_m=position_m), Ack)

    def remove(self, name: str) -> None:
        """Take it away."""
        self.bus.request("robot/obstacle", SetObstacle(op="remove", id=name), Ack)

    def send(self, pose: Pose, speed_scale: float | None = None) -> str:
        """Send a goal; its id."""
        return self.bus.request("planner/goal", SetGoal(pose=pose, speed_scale=speed_scale), GoalAccepted).goal_id

    def told(self, kind: str, n: int = 1) -> list[PlannerEvent]:
        """Wait for ``n`` events of a kind; all of that kind so far.

        An event and the status published right after it may arrive in either order: they go by two keys, of two priorities.
        """

        def of_the_kind() -> list[PlannerEvent]:
            return [event for event in self.events if event.kind == kind]

        self.until(lambda: len(of_the_kind()) >= n, f"{n} events of the kind {kind}")
        return of_the_kind()

    def kinds(self, goal_id: str) -> list[str]:
        """Kinds of the events of a goal so far."""
        return [event.kind for event in self.events if event.goal_id == goal_id]

    def reached(self, goal_id: str) -> bool:
        """Whether the goal was reached."""
        return "goal_reached" in self.kinds(goal_id)

    def is_blocked(self) -> bool:
        """Whether the planner says that it is blocked, and the arm stands."""
        return self.status is not None and self.status.state == "blocked" and self.robot is not None and self.robot.mode == "idle"

    def go(self, pose: Pose, timeout_s: float = 60.0) -> None:
        """Send a goal and wait until it is reached."""
        goal_id = self.send(pose)
        self.until(lambda: self.reached(goal_id), f"goal {goal_id}", timeout_s)

    def sees(self, at_least: int) -> None:
        """Wait until so many cells are occupied."""
        self.until(lambda: self.voxels is not None and len(self.voxels.cells) >= at_least, f"{at_least} occupied cells")

    def sees_nothing(self) -> None:
        """Wait until no cell is occupied."""
        self.until(lambda: self.voxels is not None and len(self.voxels.cells) == 0, "an empty table")

    def clearance(self) -> Clearance:
        """The physics engine's word."""
        return self.bus.request("robot/clearance", Empty(), Clearance)
