"""A question without a running stack: load the map, plan, answer."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from common.cell import load
from common.wire.messages import PlanReply, PlanRequest
from services.planner.assemble import assemble
from services.planner.config import PlannerConfig
from services.planner.memory import recall
from services.planner.offline.build import Progress
from services.planner.questions import QuestionDesk

__all__ = ["plan_offline"]


def plan_offline(
    path: Path | None, overrides: list[str], request: PlanRequest, progress: Progress = lambda _stage, _share: None
) -> PlanReply:
    """The answer of a planner that sees nothing and whose arm is at home; the map is built first where it is missing.

    Raises:
        TolmanError: config, robot or map cannot be had, or the request is impossible.
    """
    cell, config = load(path, "planner", PlannerConfig, overrides)
    parts = recall(assemble(cell, config, progress)).parts
    desk = QuestionDesk(parts, time.monotonic_ns)
    return desk.answer(request, parts.robot.home_rad, np.empty(0, dtype=np.int32))
