"""Cells among their neighbours."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from services.planner.kernels.neighbours import in_patches
from tests.support import slow_neighbours

SHAPE = (4, 5, 3)
N_CELLS = 60


@settings(deadline=None)
@given(arrays(np.bool_, N_CELLS), st.integers(1, 9))
def test_it_equals_its_slow_twin_and_leaves_its_scratch_clean(occupied: np.ndarray, least: int) -> None:
    cells = np.flatnonzero(occupied).astype(np.int32)
    marked, keep = np.zeros(N_CELLS, dtype=np.uint8), np.empty(len(cells), dtype=np.bool_)
    in_patches(cells, SHAPE, least, marked, keep)
    assert np.array_equal(keep, slow_neighbours.in_patches(cells, SHAPE, least))
    assert not marked.any()
