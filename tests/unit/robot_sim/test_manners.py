"""When people in the cell take the arm for standing."""

from __future__ import annotations

import numpy as np

from services.robot_sim.core.manners import Bystander

STILL, MOVING = np.array([0.0, 0.019]), np.array([0.0, -0.3])
MS = 1_000_000


def test_a_motion_is_noticed_one_reaction_later_and_a_stop_at_once() -> None:
    bystander = Bystander(standing_rad_s=0.02, reaction_s=0.2)
    assert bystander.sees_it_stand(0)  # nothing seen yet
    bystander.look(1000 * MS, STILL)
    bystander.look(1100 * MS, MOVING)
    assert bystander.sees_it_stand(1199 * MS)
    bystander.look(1200 * MS, MOVING)
    assert not bystander.sees_it_stand(1200 * MS)
    bystander.look(1300 * MS, STILL)
    assert bystander.sees_it_stand(1300 * MS)


def test_each_standstill_counts_anew() -> None:
    bystander = Bystander(standing_rad_s=0.02, reaction_s=0.2)
    for ms in (0, 150, 300):  # short halts, never as long as a reaction
        bystander.look(ms * MS, STILL)
        bystander.look((ms + 8) * MS, MOVING)
        assert bystander.sees_it_stand((ms + 149) * MS)
    assert not bystander.sees_it_stand(500 * MS)
