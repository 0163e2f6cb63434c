"""From a path to a motion that may be sent: smoothed, timed from the splice state, and the timed curve itself proven free."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from common.robot.trajectory import JointTrajectory
from services.planner.config import MOST_SEARCHES
from services.planner.core.check import ASTRAY_M, TOUCH_M, HandReach
from services.planner.core.find import PathFinder, Pieces, Rules
from services.planner.core.found import FoundPath, NotFound, path_length
from services.planner.core.separation import Caps, Separation
from services.planner.core.smoothing import candidates
from services.planner.core.timing import Limits, time_blends, time_curve, time_polyline
from services.planner.core.way_out import route_of
from services.planner.core.world import World
from services.planner.kernels.collision import FREE

__all__ = ["AT_REST_RAD_S", "ROUTES", "Ask", "Motion", "MotionPlanner", "Stopwatch"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
Clock = Callable[[], int]

AT_REST_RAD_S = 1e-3  # a start slower than this is a start from rest; our choice
LEADS = (1.1, 1.8)  # lead-in as a multiple of the braking distance along the velocity; 1 would be just enough to stop at its end
SAME_PLACE_RAD = 1e-6
ROUTES = 5  # paths a question is given until one stands the exact look; our choice: nearly all stand at once
LONGER = 1.1  # times the first motion's duration, that a refined one may take; our choice
# Room that shortcuts keep beyond the safety distance, one after the other until a motion is better. Measured on 177 answers (task): without
# room 41 % are, 51 % are shorter but too slow; with the second 58 %.
REFINE_ROOMS_M = (0.0, 0.02)
BLEND_SHARES = (1.0, 0.3)  # of the room between corners, that their rounding may use; less where a hand needs room; our choice


@dataclass(frozen=True, eq=False)
class Ask:
    """A question.

    Attributes:
        q_start, q_goal: (J,) rad.
        velocity_start: (J,) rad/s of an arm in motion, None at rest.
        rules, search: see :mod:`services.planner.core.find`.
        smooth: False drives the raw path with a stop at each corner.
        speed_scale: factor on the planned speed, 0..1.
        routes: paths that are tried until one stands the exact look.
        hand: what to expect of things that move; None: what the planner was made with.
    """

    q_start: F64
    q_goal: F64
    velocity_start: F64 | None = None
    rules: Rules = "checked"
    search: str = "dijkstra"
    smooth: bool = True
    speed_scale: float = 1.0
    routes: int = ROUTES
    hand: HandReach | None = None


@dataclass(frozen=True, eq=False)
class Motion:
    """An answer that may be driven.

    Attributes:
        curve: the timed curve, checked as it is.
        path: what the search found.
        smoothing: name of the level that was accepted.
        fell_back: no smooth curve was free; the arm stops at each corner.
        refined: the path was shortened for longer than a first answer waits.
    """

    curve: JointTrajectory
    path: FoundPath
    smoothing: str
    fell_back: bool
    refined: bool = False

    @cached_property
    def length_rad(self) -> float:
        """Joint length of the curve, knot to knot."""
        return path_length(self.curve.q_rad)


def _is_better(motion: Motion, than: Motion) -> bool:
    """Whether a motion is shorter than another and not much slower."""
    return motion.length_rad < than.length_rad and motion.curve.duration_s <= LONGER * than.curve.duration_s


@dataclass(frozen=True)
class _Blocked:
    """No curve along a path is free; ``piece`` of the path (from that point to the next) is where even the straight one is not."""

    piece: int


@dataclass
class Stopwatch:
    """Milliseconds by stage. The clock is an argument, so that the cores never ask for the time themselves."""

    clock_ns: Clock
    ms: dict[str, float] = field(default_factory=dict)

    def add(self, stage: str, since_ns: int) -> int:
        """Add the time since ``since_ns`` to a stage; returns now."""
        now_ns = self.clock_ns()
        self.ms[stage] = self.ms.get(stage, 0.0) + (now_ns - since_ns) / 1e6
        return now_ns


class MotionPlanner:
    """Answers questions on one roadmap. One per thread."""

    def __init__(
        self,
        finder: PathFinder,
        limits: Limits,
        hand: HandReach,
        joint_range: tuple[F64, F64],
        *,
        shortcut_checks: int,
        refine_looks: int = 0,
        separation: Separation | None = None,
    ) -> None:
        self.finder = finder
        self.pool: Executor = ThreadPoolExecutor(MOST_SEARCHES)  # for the searches of repair; it has no thread until one is needed
        self._separation = separation
        self.joint_range = joint_range
        self.checker = finder.checker
        self._limits = limits
        self.hand = hand
        self._shortcut_checks = shortcut_checks
        self._refine_looks = refine_looks

    def answer(self, world: World, ask: Ask, watch: Stopwatch) -> Motion | NotFound:
        """Find, smooth, time and check; stages of ``watch``: search, smooth, time, verify."""
        limits = self._limits.scaled(ask.speed_scale, 1.0)
        velocity = ask.velocity_start
        if velocity is None or float(np.abs(velocity).max()) < AT_REST_RAD_S:
            return self._from(world, ask, None, ask.q_start, limits, watch)
        outcome: Motion | NotFound = NotFound("no_path", "the arm cannot leave its velocity in time")
        for factor in LEADS:
            lead = ask.q_start + self._lead_in(velocity, factor)
            if not self.checker.segment(world.cells, ask.q_start, lead):
                break
            outcome = self._from(world, ask, velocity, lead, limits, watch)
            if isinstance(outcome, Motion) and not outcome.fell_back:
                return outcome
        return outcome

    def along(self, world: World, ask: Ask, found: FoundPath, watch: Stopwatch) -> Motion | None:
        """A motion from rest along a path that was found elsewhere; None: no curve along it is free in ``world``."""
        outcome = self._drive(world, ask, found, None, self._limits.scaled(ask.speed_scale, 1.0), watch)
        return outcome if isinstance(outcome, Motion) else None

    def refined(self, world: World, ask: Ask, motion: Motion, watch: Stopwatch) -> Motion:
        """The same motion from rest along a shorter path; ``motion`` itself where none is free, or none that is not much slower.

        What is shortest passes close by what is seen, and slowly: where that is too slow, shortcuts that keep more room are tried. It takes
        some milliseconds, bounded by ``refine_looks``; what is sent at once to dodge is not refined first. Stage of ``watch``: refine.
        """
        at_rest = ask.velocity_start is None or float(np.abs(ask.velocity_start).max()) < AT_REST_RAD_S
        if not (at_rest and ask.smooth and ask.rules == "checked" and self._refine_looks > 0 and len(motion.path.q_rad) > 2):
            return motion
        began, limits = watch.clock_ns(), self._limits.scaled(ask.speed_scale, 1.0)
        refined = motion
        for room_m in REFINE_ROOMS_M:
            pieces = self.finder.refined(world, motion.path, self._refine_looks, room_m).without_repeats(SAME_PLACE_RAD)
            better = self._rounded(world, ask, motion.path, pieces, None, limits, Stopwatch(watch.clock_ns))
            if isinstance(better, Motion) and not better.fell_back and _is_better(better, motion):
                refined = replace(better, smoothing=f"{better.smoothing}, refined", refined=True)
                break
        watch.add("refine", began)
        return refined

    def _lead_in(self, velocity: F64, factor: float) -> F64:
        """The way (J,) along ``velocity`` in which the arm could just stop, times ``factor``.

        Along a straight line each joint brakes in proportion, and the one that runs out of acceleration first bounds the path's
        deceleration a: |v|^2 / (2 a).
        """
        speed = float(np.linalg.norm(velocity))
        direction = velocity / speed
        deceleration = float(np.min(self._limits.acceleration / np.maximum(np.abs(direction), 1e-9)))
        return np.asarray(direction * (factor * speed**2 / (2.0 * deceleration)))

    def _from(self, world: World, ask: Ask, velocity: F64 | None, q_from: F64, limits: Limits, watch: Stopwatch) -> Motion | NotFound:
        """A motion that leaves ``ask.q_start`` (with ``velocity``, straight to ``q_from``) and goes on from there by the map.

        Where the exact look finds a piece of the path blocked, the map is asked again without that piece.
        """
        began = watch.clock_ns()
        if ask.rules == "paper":
            found = self.finder.find_paper(world, q_from, ask.q_goal, ask.search)
            watch.add("search", began)
            return found if isinstance(found, NotFound) else self._settled(self._drive(world, ask, found, velocity, limits, watch))
        began = watch.clock_ns()
        route = route_of(self.finder, world, q_from, ask.q_goal, ask.search, self.joint_range)
        watch.add("search", began)
        outcome: Motion | NotFound | _Blocked = route if isinstance(route, NotFound) else _Blocked(0)
        for _ in range(ask.routes):
            if isinstance(route, NotFound) or not isinstance(outcome, _Blocked):
                break
            began = watch.clock_ns()
            found = route.find()
            watch.add("search", began)
            if isinstance(found, NotFound):
                return found
            outcome = self._drive(world, ask, found, velocity, limits, watch)
            if isinstance(outcome, _Blocked):
                route.ban(found, outcome.piece)
        return self._settled(outcome)

    @staticmethod
    def _settled(outcome: Motion | NotFound | _Blocked) -> Motion | NotFound:
        return NotFound("no_path", "no curve along the way is free") if isinstance(outcome, _Blocked) else outcome

    def _drive(
        self, world: World, ask: Ask, found: FoundPath, velocity: F64 | None, limits: Limits, watch: Stopwatch
    ) -> Motion | NotFound | _Blocked:
        """The smoothest motion along a path that is free; else the piece of the path that is not."""
        began = watch.clock_ns()
        shortens = ask.smooth and ask.rules == "checked"
        pieces = self.finder.cut_corners(world, found, self._shortcut_checks) if shortens else Pieces.of(found)
        pieces = pieces if velocity is None else pieces.after(ask.q_start)
        pieces = pieces.without_repeats(SAME_PLACE_RAD)
        if len(pieces.q_rad) == 1:
            here = JointTrajectory(np.zeros(1), pieces.q_rad.copy(), np.zeros_like(pieces.q_rad))
            return Motion(here, found, "already there", False)
        watch.add("smooth", began)
        if ask.smooth:
            smoothing = self._smoothed_by_the_paper if ask.rules == "paper" else self._rounded
            smooth = smoothing(world, ask, found, pieces, velocity, limits, watch)
            if smooth is not None:
                return smooth
        return self._stop_at_corners(world, ask, found, pieces.q_rad, velocity, limits, watch)

    def _stop_at_corners(
        self, world: World, ask: Ask, found: FoundPath, path: F64, velocity: F64 | None, limits: Limits, watch: Stopwatch
    ) -> Motion | NotFound | _Blocked:
        """A stop at each corner of the shortened path, else of the path as it was found; else the piece of it that is not free."""
        raw = found.q_rad if velocity is None else np.vstack([ask.q_start, found.q_rad])
        piece = 0
        for corners in (path, raw):
            began = watch.clock_ns()
            polyline = time_polyline(corners, limits, velocity, self._caps(world, ask))
            began = watch.add("time", began)
            if polyline is None:
                return NotFound("no_path", "the arm is too fast to leave its way here")
            timed, corner_s = polyline
            blocked_s = None if ask.rules == "paper" else self._blocked_at(world, ask, found, timed)
            watch.add("verify", began)
            if blocked_s is None:
                return Motion(timed, found, "stop at each corner", ask.smooth)
            piece = int(np.searchsorted(corner_s, blocked_s, side="right")) - 1
        return _Blocked(piece if velocity is None else piece - 1)

    def _rounded(
        self, world: World, ask: Ask, found: FoundPath, pieces: Pieces, velocity: F64 | None, limits: Limits, watch: Stopwatch
    ) -> Motion | _Blocked | None:
        """The path with its corners rounded, as far as they are free; a corner that cannot be rounded is stopped at."""
        cells = world.cells if found.leaving is None else found.leaving.rest.cells
        for share in BLEND_SHARES:
            began = watch.clock_ns()
            reach, blocked = self.checker.fit_blends(cells, pieces.q_rad, pieces.proven, share)
            began = watch.add("smooth", began)
            if blocked >= 0:
                return _Blocked(int(pieces.origin[blocked]))
            timed = time_blends(pieces.q_rad, reach, limits, velocity, self._caps(world, ask))
            began = watch.add("time", began)
            if timed is None:
                continue
            is_proven = found.leaving is None and self.checker.strays_m(timed.astray_rad) <= ASTRAY_M
            blocked_s = self._hand_at(world, ask, found, timed.curve) if is_proven else self._blocked_at(world, ask, found, timed.curve)
            watch.add("verify", began)
            if blocked_s is None:
                n_stops = int(np.count_nonzero(reach[1:-1] == 0.0))
                return Motion(timed.curve, found, f"blends {share:g}, {n_stops} stops", n_stops > 0)
        return None

    def _caps(self, world: World, ask: Ask) -> Caps | None:
        """How fast the arm may pass the cells; the paper's rules know no such thing."""
        return None if self._separation is None or ask.rules == "paper" else self._separation.caps(world)

    def _smoothed_by_the_paper(
        self, world: World, ask: Ask, found: FoundPath, pieces: Pieces, velocity: F64 | None, limits: Limits, watch: Stopwatch
    ) -> Motion | None:
        """The smoothest NURBS whose best matches are free (section IV)."""
        began = watch.clock_ns()
        for curve in candidates(pieces.q_rad, lead_in=velocity is not None):
            began = watch.add("smooth", began)
            timed = time_curve(curve, limits, velocity)
            began = watch.add("time", began)
            points = curve(np.linspace(0.0, 1.0, max(2, 4 * len(found.q_rad))))
            free = timed is not None and all(world.counts.node[self.finder.best_match(q)] == 0 for q in points)
            began = watch.add("verify", began)
            if timed is not None and free:
                return Motion(timed, found, curve.name, False)
        return None

    def _hand_at(self, world: World, ask: Ask, found: FoundPath, timed: JointTrajectory) -> float | None:
        """Time at which something that moves could come too near before the arm can stand; None if nothing could."""
        return self.checker.hand_meets(world.recent, timed, ask.hand or self.hand, safety_m=None if found.leaving is None else TOUCH_M)

    def _blocked_at(self, world: World, ask: Ask, found: FoundPath, timed: JointTrajectory) -> float | None:
        """Time of the first point of the timed curve that must not be driven; None if it is free."""
        leaving = found.leaving
        met = self._hand_at(world, ask, found, timed)
        if met is not None:
            return met
        verdict, _, at_s = self.checker.curve((world if leaving is None else leaving.rest).cells, timed)
        if verdict != FREE:
            return at_s
        return None if leaving is None or leaving.leads_out(self.checker, timed.q_rad) else 0.0
