"""What the picture of a demo shows."""

from __future__ import annotations

import numpy as np

from clients.demo.picture import LIMITS_M, _limits_m


def test_it_shows_table_and_bins_at_the_least_and_every_way_wholly() -> None:
    np.testing.assert_array_equal(_limits_m([np.zeros((1, 3))]), LIMITS_M)
    way = np.array([[0.1, -0.9, 0.2], [0.3, 0.2, 0.95]])
    limits_m = _limits_m([np.zeros((1, 3)), way])
    assert (way >= limits_m[:, 0]).all() and (way <= limits_m[:, 1]).all()
    np.testing.assert_array_equal(limits_m[0], LIMITS_M[0])
