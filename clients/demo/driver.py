"""The demo's state machine: which goal and which obstacle to send now. Pure: time and what is seen are arguments."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from clients.demo.script import Act, Goal
from common.wire.messages import SetGoal, SetObstacle

__all__ = ["Driver", "Orders", "Seen", "Tally"]

SUDDEN_WAITS_S = 3.0  # our choice: an obstacle that finds no fair moment within this time is left out
RESEND_AFTER_S = 1.0  # our choice: a planner that does not know its goal for this long has been restarted


@dataclass(frozen=True)
class Seen:
    """What the bus told since the last step.

    Attributes:
        ended: goals that ended, and how (kinds of planner events).
        planner_goal_id: the goal that the planner works on by its own word; None: none, or no word.
        is_fair: whether an obstacle may appear now, given where the arm is and goes.
    """

    ended: Mapping[str, str]
    planner_goal_id: str | None
    is_fair: Callable[[SetObstacle], bool]


@dataclass(frozen=True)
class Orders:
    """What to send now: obstacles first, then the goal."""

    obstacles: tuple[SetObstacle, ...]
    goal: SetGoal | None


@dataclass
class Tally:
    """Counts of goals and obstacles."""

    reached_pick: int = 0
    reached_place: int = 0
    given_up: int = 0
    resent: int = 0
    refused: int = 0
    obstacles_shown: int = 0
    obstacles_left_out: int = 0

    @property
    def reached(self) -> int:
        """Goals reached."""
        return self.reached_pick + self.reached_place

    @property
    def cycles(self) -> int:
        """How often both poses were reached."""
        return min(self.reached_pick, self.reached_place)


class Driver:
    """Sends goal after goal, and the acts when their time has come. Tell it the goal's id by :meth:`accepted` or :meth:`refused`."""

    def __init__(self, goals: Iterator[Goal], acts: Iterator[Act], *, patience_s: float) -> None:
        self.tally = Tally()
        self._goals = goals
        self._acts = acts
        self._patience_s = patience_s
        self._goal = next(goals)
        self._goal_id: str | None = None
        self._sent_s = 0.0
        self._known_s = 0.0
        self._next_act = next(acts)
        self._to_remove: list[tuple[float, str]] = []

    def step(self, now_s: float, seen: Seen) -> Orders:
        """Orders of this moment; ``now_s`` counts from the demo's start."""
        self._follow_goal(now_s, seen)
        return Orders(tuple(self._vanishing(now_s) + self._appearing(now_s, seen)), self._goal.request if self._goal_id is None else None)

    def accepted(self, goal_id: str, now_s: float) -> None:
        """The goal of the last orders is under way."""
        self._goal_id, self._sent_s, self._known_s = goal_id, now_s, now_s

    def refused(self) -> None:
        """The goal of the last orders cannot be done: take the next."""
        self.tally.refused += 1
        self._take_next()

    def _follow_goal(self, now_s: float, seen: Seen) -> None:
        if self._goal_id is None:
            return
        end = seen.ended.get(self._goal_id)
        if end == "goal_reached":
            if self._goal.region == "pick":
                self.tally.reached_pick += 1
            else:
                self.tally.reached_place += 1
            self._take_next()
        elif end is not None or now_s - self._sent_s > self._patience_s:
            self.tally.given_up += 1
            self._take_next()
        elif seen.planner_goal_id == self._goal_id:
            self._known_s = now_s
        elif now_s - self._known_s > RESEND_AFTER_S:
            self.tally.resent += 1
            self._goal_id = None

    def _take_next(self) -> None:
        self._goal, self._goal_id = next(self._goals), None

    def _vanishing(self, now_s: float) -> list[SetObstacle]:
        due = [name for at_s, name in self._to_remove if at_s <= now_s]
        self._to_remove = [(at_s, name) for at_s, name in self._to_remove if at_s > now_s]
        return [SetObstacle(op="remove", id=name) for name in due]

    def _appearing(self, now_s: float, seen: Seen) -> list[SetObstacle]:
        orders: list[SetObstacle] = []
        while self._next_act.at_s <= now_s:
            act = self._next_act
            if act.is_sudden and not all(seen.is_fair(obstacle) for obstacle in act.obstacles):
                if now_s - act.at_s < SUDDEN_WAITS_S:
                    break
                self.tally.obstacles_left_out += len(act.obstacles)
            else:
                orders += act.obstacles
                self.tally.obstacles_shown += len(act.obstacles)
                self._to_remove += [(now_s + act.life_s, obstacle.id) for obstacle in act.obstacles]
            self._next_act = next(self._acts)
        return orders
