"""Which neurons and edges a payload bars: those on whose way it meets the static layer or the arm."""

from __future__ import annotations

import numpy as np

from common.kernel import kernel
from services.planner.kernels.collision import FREE, pose_verdict
from services.planner.kernels.way import line_is_free

__all__ = ["bar"]


@kernel
def bar(arm, solids, cells, safety_m, step_m, q_rad, edges, first_node, first_edge, node_barred, edge_barred):  # type: ignore[no-untyped-def]
    """Set ``node_barred`` (N,) and ``edge_barred`` (M,) uint8, from the first ones on, where a pose or the straight way is not free.

    Edges of a barred neuron are blocked anyway and not looked at. ``arm``, ``solids``, ``cells``: as for the one check.
    """
    n_joints = q_rad.shape[1]
    rotation, translation = np.empty((n_joints + 1, 3, 3)), np.empty((n_joints + 1, 3))
    for k in range(first_node, len(q_rad)):
        verdict, _ = pose_verdict(arm, solids, cells, safety_m, q_rad[k], rotation, translation)
        node_barred[k] = verdict != FREE
    for e in range(first_edge, len(edges)):
        a, b = edges[e, 0], edges[e, 1]
        if node_barred[a] or node_barred[b]:
            continue
        edge_barred[e] = not line_is_free(arm, solids, cells, safety_m, step_m, q_rad[a], q_rad[b])
