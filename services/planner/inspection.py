"""Answers to ``planner/map``: parts of the map for drawing, and what one neuron or one cell means."""

from __future__ import annotations

from typing import Any

import numpy as np

from common.errors import RequestError
from common.wire.messages import MapQuery, MapReply
from services.planner.assemble import Parts
from services.planner.core.lookup import cells_of_pose
from services.planner.core.reflex import Reflex

__all__ = ["map_reply"]


def map_reply(request: MapQuery, parts: Parts, reflex: Reflex) -> MapReply:
    """The parts asked for.

    Raises:
        RequestError: neuron or cell out of range.
    """
    roadmap, counts = parts.roadmap, reflex.vision.counts
    out: dict[str, Any] = {}
    if "neurons" in request.include:
        out["q_rad"] = roadmap.neurons_rad
    if "tool_positions" in request.include:
        poses = parts.robot.joint_poses(roadmap.neurons_rad)[:, -1] @ parts.robot.T_joint_tool
        out["tool_m"] = np.ascontiguousarray(poses[:, :3, 3])
    if "edges" in request.include:
        out["edges"] = roadmap.edges
    if "blocked" in request.include:
        out["blocked"] = (counts.node > 0).astype(np.uint8)
    if "path" in request.include:
        sent = reflex.underway.sent
        motion = sent.motion if sent is not None else None
        out["path"] = motion.path.neurons if motion is not None else np.empty(0, dtype=np.int32)
    if request.neuron is not None:
        if not 0 <= request.neuron < roadmap.n_neurons:
            raise RequestError(f"neuron: {request.neuron} is outside 0..{roadmap.n_neurons - 1}", code="out_of_range")
        checker = reflex.checker
        out["cells"] = cells_of_pose(checker.arm, parts.grid, roadmap.neurons_rad[request.neuron], safety_m=checker.safety_m)
    if request.cell is not None:
        if not 0 <= request.cell < parts.grid.n_cells:
            raise RequestError(f"cell: {request.cell} is outside 0..{parts.grid.n_cells - 1}", code="out_of_range")
        out["neurons"] = roadmap.table.neurons_of(request.cell).astype(np.int32)
        out["blocked_edges"] = roadmap.table.edges_of(request.cell).astype(np.int32)
    return MapReply(**out)
