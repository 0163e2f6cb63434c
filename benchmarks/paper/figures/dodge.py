"""A photo series of one dodge in the running stack, drawn from what passed on the bus."""

from __future__ import annotations

import time
from pathlib import Path

from benchmarks.paper.figures.dodge_record import Dodge, Recorder, read_dodge
from benchmarks.paper.known import known
from benchmarks.paper.outcome import Outcome, Table
from benchmarks.paper.study import Study
from clients.demo.arm import Arm
from clients.demo.config import DemoConfig
from clients.demo.run import DemoRun
from clients.stack import OwnStack, free_endpoint
from common import cell
from common.bus.session import BusAddress
from common.cell import SolidConfig
from common.robot.model import load_robot
from deploy.processes import StackOptions

__all__ = ["Series", "measure"]

RECORD = "data/dodge-record.npz"
INTRO = (
    "The whole stack runs in simulation (four depth cameras, perception, planner, robot; nobody reads the ground truth) while a hand and "
    "boxes come in the way. Of all new ways taken in motion during {seconds} the one that bends most from the way before is shown, from "
    "what passed on the bus: voxels seen by the cameras yellow, path planned at that moment green, path driven so far cyan. The paper's "
    "photo series shows the same on the real arm; it replans at least every {tick} and says {replan} for it."
)


class Series:
    """A dodge with what stands still in its pictures."""

    def __init__(self, dodge: Dodge | None, arm: Arm, fixed: list[SolidConfig]) -> None:
        self.dodge, self.arm, self.fixed = dodge, arm, fixed


def measure(study: Study) -> Outcome:
    """Run the stack and record, or read what was recorded."""
    arm = Arm(load_robot(study.cell.robot))
    dodge: Dodge | None
    figures: dict[str, float | None] = {}
    seconds = "a recorded run"
    if study.stack.recorded is not None:
        dodge = read_dodge(study.stack.recorded)
    else:
        dodge, figures = _record(study, arm)
        seconds = f"{study.scale.dodge_s:.0f} s"
    rows = [] if dodge is None else [{"row": f"photo {k}", "at_s": at_s} for k, at_s in enumerate(dodge.at_s)]
    intro = INTRO.format(seconds=seconds, tick=known("tick_s"), replan=known("replan_s"))
    if dodge is None:
        intro += f" **No dodge was seen in {seconds}**: no new way in motion bent by 5 cm; a longer run or another seed shows one."
    return Outcome(intro, rows=rows, tables=_tables(figures, dodge), facts=figures, data=Series(dodge, arm, list(study.cell.static)))


def _record(study: Study, arm: Arm) -> tuple[Dodge | None, dict[str, float | None]]:
    _, config = cell.load(study.stack.config, "demo", DemoConfig, list(study.stack.overrides))
    options = StackOptions(BusAddress(free_endpoint(), "paper"), study.stack.config, study.stack.overrides, "WARNING")
    recorder = Recorder(arm)
    own = OwnStack(options)
    try:
        with own.connect() as bus:
            study.tell("starting the stack", None)
            own.wait_ready(bus)
            demo = DemoRun(bus, arm, config, study.seed)
            demo.watchers.append(recorder.observe)
            demo.prepare()
            began_s = time.monotonic()
            demo.play(
                study.scale.dodge_s,
                lambda: False,
                lambda: study.tell("the stack runs", (time.monotonic() - began_s) / study.scale.dodge_s),
            )
            got = demo.finish()
    finally:
        own.stop()
    reaction = got["reaction_ms"] or {}
    figures = {
        "goals_reached": got["goals_reached"],
        "contacts_caused": got["contacts_caused"],
        "replans_blocked": got["replans"].get("blocked", 0),
        "reaction_ms_p50": reaction.get("p50"),
        "reaction_ms_p95": reaction.get("p95"),
    }
    return recorder.best(), figures


def _tables(figures: dict[str, float | None], dodge: Dodge | None) -> list[Table]:
    if not figures:
        return []
    rows = [
        ["goals reached", f"{figures['goals_reached']}", "not at hand"],
        ["contacts that the arm caused", f"{figures['contacts_caused']}", "not at hand"],
        ["new ways because the old one was blocked", f"{figures['replans_blocked']}", "not at hand"],
        ["exposure of an obstacle to the new motion accepted by the robot, ms, median / p95", _milliseconds(figures), "not at hand"],
        ["bend of the dodge shown, cm", "–" if dodge is None else f"{100.0 * dodge.bend_m:.0f}", "not at hand"],
    ]
    return [Table("The run that the series is from", ("what", "ours", "paper"), rows)]


def _milliseconds(figures: dict[str, float | None]) -> str:
    low, high = figures["reaction_ms_p50"], figures["reaction_ms_p95"]
    return "–" if low is None or high is None else f"{low:.0f} / {high:.0f}"


def record_path(out: Path) -> Path:
    """Where a report keeps its recorded dodge."""
    return out / RECORD
