"""The camera section: what it makes, and what it refuses by name."""

from __future__ import annotations

import numpy as np
import pytest

from common.cell import load
from common.errors import ConfigError
from services.robot_sim.cameras.config import CamerasConfig

VIEW = '{name="a", position_m=[1,0,1], look_at_m=[0,0,0]}'


def test_the_ur3_cell_has_four_d435_that_look_at_the_table() -> None:
    _, config = load(None, "cameras", CamerasConfig)
    models = config.models()
    assert [(m.width, m.height) for m in models] == [(424, 240)] * 4
    for m in models:
        assert np.degrees(2 * np.arctan(m.width / 2 / m.fx_px)) == pytest.approx(87.0)
        assert np.degrees(2 * np.arctan(m.height / 2 / m.fy_px)) == pytest.approx(58.0)
        ray = m.T_world_camera[:3, 2]
        assert m.T_world_camera[2, 3] > 0.5
        assert ray[2] < 0.0
    assert {tuple(np.sign(m.T_world_camera[:2, 3])) for m in models} == {(1, 1), (1, -1), (-1, 1), (-1, -1)}


@pytest.mark.parametrize(
    ("override", "named"),
    [
        ("cameras.widht=424", "widht"),
        ("cameras.rate_hz=0", "rate_hz"),
        ("cameras.max_range_m=0.1", "max_range_m"),
        ("cameras.noise.edge_dropout=1.5", "edge_dropout"),
        ('cameras.views=[{name="a", position_m=[0,0,1], look_at_m=[0,0,0]}]', "no view direction"),
        (
            'cameras.views=[{name="a", position_m=[1,0,1], look_at_m=[0,0,0]}, {name="a", position_m=[0,1,1], look_at_m=[0,0,0]}]',
            "same name",
        ),
    ],
)
def test_a_wrong_value_is_an_error_that_names_it(override: str, named: str) -> None:
    with pytest.raises(ConfigError, match=named):
        load(None, "cameras", CamerasConfig, [override])
