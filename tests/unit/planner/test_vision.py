"""What counts as moving: patches of cells that have just appeared."""

from __future__ import annotations

import numpy as np

from common.geometry.grid import Grid
from services.planner.core.cognitive_map import CognitiveMap
from services.planner.core.lookup import LookupTable
from services.planner.core.roadmap import Roadmap
from services.planner.core.vision import FLICKER_S, RECENT_S, Vision

GRID = Grid((0.0, 0.0, 0.0), (10, 10, 10), 0.02)
FRAME_S = 1 / 15


def _vision() -> Vision:
    rows = np.zeros((1, GRID.n_cells + 1), dtype=np.int64)
    nobody = np.empty(0, dtype=np.uint16)
    table = LookupTable(rows, nobody, rows, nobody, np.empty(0, dtype=np.int32))
    learned = CognitiveMap(np.zeros((2, 6)), np.array([[0, 1]], dtype=np.int32))
    return Vision(GRID, Roadmap.of(learned, table, "gng"), unavoidable_frames=3)


def _block(x: int) -> np.ndarray:
    """A block of 2 x 3 x 3 cells whose lowest corner is at cell ``x`` along x."""
    filled = np.zeros(GRID.shape, dtype=bool)
    filled[x : x + 2, 3:6, 3:6] = True
    return np.flatnonzero(filled).astype(np.int32)


def _recent(vision: Vision) -> int:
    return len(vision.world.recent.centre_m)


def test_a_thing_that_comes_is_recent_for_a_while_and_then_stands() -> None:
    vision = _vision()
    vision.see(0.0, _block(2))
    assert _recent(vision) == 18
    vision.see(RECENT_S / 2, _block(2))
    assert _recent(vision) == 18
    vision.see(RECENT_S + FRAME_S, _block(2))
    assert _recent(vision) == 0
    assert len(vision.world.cells.centre_m) == 18


def test_a_thing_that_moves_shows_its_new_front() -> None:
    vision = _vision()
    vision.see(0.0, _block(2))
    vision.see(RECENT_S + FRAME_S, _block(3))
    assert _recent(vision) == 9


def test_single_cells_that_flicker_at_a_thing_that_stands_do_not_move() -> None:
    vision = _vision()
    rng = np.random.default_rng(3)
    edge = np.setdiff1d(_block(4), _block(3))
    for k in range(90):
        some = edge if k % 30 == 0 else rng.choice(edge, 7, replace=False)
        vision.see(k * FRAME_S, np.union1d(_block(3), some).astype(np.int32))
        if k * FRAME_S > RECENT_S + FLICKER_S:
            assert _recent(vision) == 0, f"frame {k}"


def test_a_patch_that_was_gone_for_longer_has_come_anew() -> None:
    vision = _vision()
    vision.see(0.0, _block(2))
    vision.see(RECENT_S + 1.0, np.empty(0, dtype=np.int32))
    vision.see(RECENT_S + 1.0 + 2 * FLICKER_S, _block(2))
    assert _recent(vision) == 18
