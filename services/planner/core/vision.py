"""What the planner knows of the cells: the live set, what changed, what is recent, what no path can avoid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.geometry.grid import Grid
from services.planner.core.lookup import BlockedCounts
from services.planner.core.roadmap import Roadmap
from services.planner.core.world import World, cells_of
from services.planner.kernels.cells import Cells
from services.planner.kernels.neighbours import in_patches

__all__ = ["PATCH_CELLS", "RECENT_S", "Vision"]

I32 = NDArray[np.int32]
RECENT_S = 2.0  # cells that appeared within this time may belong to something that moves: a hand that pauses is still a hand; our choice
# What moves shows a patch of new cells, noise at the edge of what stands shows single ones, again and again. Measured on a standing box of
# 640 cells seen by four noisy cameras: up to 23 cells appeared within any 2 s, 1 of them with three others beside it.
PATCH_CELLS = 4
FLICKER_S = 0.5  # a cell that was gone for less than this has not newly appeared; our choice


class Vision:
    """The live cells and their counts on the map. The difference to the last frame is our own, never the sender's."""

    def __init__(self, grid: Grid, roadmap: Roadmap, *, unavoidable_frames: int) -> None:
        self.grid = grid
        self.counts = roadmap.counts(grid)
        self._unavoidable = roadmap.table.unavoidable
        self._unavoidable_frames = unavoidable_frames
        self._frames_in_reach = 0
        self._appeared_s = np.full(grid.n_cells, -np.inf)
        self._gone_s = np.full(grid.n_cells, -np.inf)
        self._marked = np.zeros(grid.n_cells, dtype=np.uint8)
        self.world = World.of(grid, self.counts)
        self.appeared = cells_of(grid, self.counts.cells)
        self._seen = self.counts.cells

    def see(self, now_s: float, cells: I32) -> bool:
        """Take a frame's cells (C,) ascending and unique; True if anything changed."""
        self._seen = cells
        base = np.intersect1d(cells, self._unavoidable, assume_unique=True)
        self._frames_in_reach = self._frames_in_reach + 1 if len(base) else 0
        appeared, gone = self.counts.set_cells(np.setdiff1d(cells, self._unavoidable, assume_unique=True))
        self._gone_s[gone] = now_s
        self._appeared_s[appeared[now_s - self._gone_s[appeared] >= FLICKER_S]] = now_s
        self.appeared = cells_of(self.grid, appeared)
        recent = self._recent(now_s)
        changed = bool(len(appeared) or len(gone))
        if changed or len(recent) != len(self.world.recent.centre_m):
            self.world = World.of(self.grid, self.counts, recent)
        return changed

    @property
    def seen(self) -> Cells:
        """All that the last frame shows, cells that no path can avoid among them."""
        return cells_of(self.grid, self._seen)

    def take(self, roadmap: Roadmap, counts: BlockedCounts) -> None:
        """The map has grown: from now on ``counts`` on ``roadmap``, set to the cells that were live on the old one.

        A cell that the old map could not avoid and the new one can is not among them: with the next frame it appears, and what is under
        way is looked at again.
        """
        counts.set_cells(self.counts.cells)
        self._unavoidable = roadmap.table.unavoidable
        self.counts = counts
        self.world = World(self.grid, counts, self.world.cells, self.world.recent)

    def _recent(self, now_s: float) -> I32:
        """Cells (n,) that may belong to something that moves."""
        live = self.counts.cells
        young = live[now_s - self._appeared_s[live] < RECENT_S]
        keep = np.empty(len(young), dtype=np.bool_)
        in_patches(young, self.grid.shape, PATCH_CELLS, self._marked, keep)
        return young[keep]

    @property
    def protective(self) -> str:
        """Why the arm must stand whatever the map says: something lasting in cells that every neuron sweeps. Empty if nothing."""
        if self._frames_in_reach >= self._unavoidable_frames:
            return "something is where the arm cannot avoid it (around its base)"
        return ""
