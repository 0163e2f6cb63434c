"""What the planner knows of the cells: the live set, what changed, what is recent, what no path can avoid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.geometry.grid import Grid
from services.planner.core.lookup import BlockedCounts
from services.planner.core.roadmap import Roadmap
from services.planner.core.world import World, cells_of

__all__ = ["RECENT_S", "Vision"]

I32 = NDArray[np.int32]
RECENT_S = 2.0  # cells that appeared within this time may belong to something that moves: a hand that pauses is still a hand; our choice


class Vision:
    """The live cells and their counts on the map. The difference to the last frame is our own, never the sender's."""

    def __init__(self, grid: Grid, roadmap: Roadmap, *, unavoidable_frames: int) -> None:
        self.grid = grid
        self.counts = BlockedCounts(roadmap.table, roadmap.n_neurons, roadmap.n_edges)
        self._unavoidable = roadmap.table.unavoidable
        self._unavoidable_frames = unavoidable_frames
        self._frames_in_reach = 0
        self._appeared_s = np.full(grid.n_cells, -np.inf)
        self.world = World.of(grid, self.counts)
        self.appeared = cells_of(grid, self.counts.cells)

    def see(self, now_s: float, cells: I32) -> bool:
        """Take a frame's cells (C,) ascending and unique; True if anything changed."""
        base = np.intersect1d(cells, self._unavoidable, assume_unique=True)
        self._frames_in_reach = self._frames_in_reach + 1 if len(base) else 0
        appeared, gone = self.counts.set_cells(np.setdiff1d(cells, self._unavoidable, assume_unique=True))
        self._appeared_s[appeared] = now_s
        self.appeared = cells_of(self.grid, appeared)
        live = self.counts.cells
        recent = live[now_s - self._appeared_s[live] < RECENT_S]
        changed = bool(len(appeared) or len(gone))
        if changed or len(recent) != len(self.world.recent.centre_m):
            self.world = World.of(self.grid, self.counts, recent)
        return changed

    @property
    def protective(self) -> str:
        """Why the arm must stand whatever the map says: something lasting in cells that every neuron sweeps. Empty if nothing."""
        if self._frames_in_reach >= self._unavoidable_frames:
            return "something is where the arm cannot avoid it (around its base)"
        return ""
