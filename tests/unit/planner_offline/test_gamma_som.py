from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.planner.core.gamma_som import GammaSom, GammaSomParameters
from services.planner.core.lattice import lattice_of, principal_plane
from services.planner.kernels import gamma_som as kernel
from services.planner.kernels.som import CUT
from tests.support import slow_som
from tests.support.joint_samples import ring

SHAPE = (7, 9)
CROSSING = 20  # the sample of each way that lies in the middle
SMALL = GammaSomParameters(
    rows=10, columns=10, n_contexts=2, beta=0.5, a_w=0.5, epochs=30, sigma_start_steps=4.0, sigma_end_steps=0.8, rate_end=0.05
)


def two_ways_through_one_point() -> tuple[np.ndarray, np.ndarray]:
    """Left to right and bottom to top: sample CROSSING of both is the origin."""
    along = np.linspace(-1.0, 1.0, 2 * CROSSING + 1)
    still = np.zeros_like(along)
    samples = np.concatenate([np.stack([along, still], axis=1), np.stack([still, along], axis=1)])
    return samples, np.array([0, len(along)])


def figure_eight(n: int = 80) -> np.ndarray:
    """One round, away from the crossing and back to where it began; the crossing is passed at a quarter and at three quarters."""
    t = np.linspace(0.0, 2 * np.pi, n, endpoint=False) + np.pi / 2
    return np.stack([np.sin(t), np.sin(2 * t)], axis=1)


@pytest.mark.parametrize("n_contexts", [0, 1, 2, 4])
def test_kernel_equals_its_slow_twin(n_contexts: int) -> None:
    samples = ring(240, n_joints=3)
    first, stop = np.array([100, 0, 160, 40]), np.array([160, 40, 240, 100])  # in the order shown
    n = int(np.sum(stop - first))
    rate, spread = np.linspace(0.4, 0.02, n), np.linspace(9.0, 0.5, n)
    a = GammaSomParameters(n_contexts=n_contexts, a_w=0.6).distance_weights
    weight = principal_plane(samples, *SHAPE)
    lattice = lattice_of(np.tile(weight, (1, n_contexts + 1)), np.repeat(a, 3), *SHAPE)
    contexts = np.repeat(weight[:, None], n_contexts, axis=1)
    winner, target = np.zeros(len(samples), dtype=np.int32), np.zeros(3 * (n_contexts + 1))
    kernel.present(lattice, samples, first, stop, 0.4, rate, spread, winner, target)
    shown = [samples[b:e] for b, e in zip(first, stop, strict=True)]
    expected = slow_som.present_in_context(weight, contexts, SHAPE, shown, a, 0.4, rate, spread, CUT)
    assert np.concatenate([winner[b:e] for b, e in zip(first, stop, strict=True)]).tolist() == expected
    np.testing.assert_allclose(lattice.vector[:, :3], weight, rtol=0, atol=1e-12)
    np.testing.assert_allclose(lattice.vector[:, 3:], contexts.reshape(len(weight), -1), rtol=0, atol=1e-12)


def test_where_two_ways_cross_the_winner_knows_the_way() -> None:
    samples, starts = two_ways_through_one_point()
    winners = GammaSom(SMALL).fit(samples, starts, 0).winners(samples, starts)
    assert winners[CROSSING] != winners[starts[1] + CROSSING]


@pytest.mark.parametrize("blind", [{"a_w": 1.0}, {"n_contexts": 0}])
def test_without_context_it_does_not(blind: dict[str, float]) -> None:
    samples, starts = two_ways_through_one_point()
    forgetful = GammaSomParameters(**{**vars(SMALL), **blind})
    model = GammaSom(forgetful).fit(samples, starts, 0)
    winners = model.winners(samples, starts)
    assert winners[CROSSING] == winners[starts[1] + CROSSING] == model.best_match(samples[CROSSING])


def test_a_figure_eight_is_passed_by_two_units_at_its_crossing() -> None:
    eight = figure_eight()
    samples = np.concatenate([eight, eight[::-1]])
    starts = np.array([0, len(eight)])
    model = GammaSom(SMALL).fit(samples, starts, 0)
    winners = model.winners(eight, starts[:1])
    first, second = len(eight) // 4, 3 * len(eight) // 4
    np.testing.assert_allclose(eight[first], eight[second], atol=1e-9)
    assert winners[first] != winners[second]
    assert model.best_match(eight[first]) == model.best_match(eight[second] + 1e-12)


def test_contexts_restart_with_each_trajectory() -> None:
    samples, starts = two_ways_through_one_point()
    model = GammaSom(SMALL).fit(samples, starts, 0)
    both = model.winners(samples, starts)
    alone = [model.winners(part, starts[:1]) for part in np.split(samples, starts[1:])]
    np.testing.assert_array_equal(both, np.concatenate(alone))
    as_one = model.winners(samples, starts[:1])
    assert np.any(as_one[starts[1] : starts[1] + 5] != both[starts[1] : starts[1] + 5]), "the end of the first way is not remembered"


def test_the_order_in_time_is_learned_and_the_order_of_trajectories_is_drawn() -> None:
    samples, starts = two_ways_through_one_point()
    fitted = GammaSom(SMALL).fit(samples, starts, 0).to_map().q_rad
    backwards = np.concatenate([part[::-1] for part in np.split(samples, starts[1:])])
    assert fitted.tobytes() != GammaSom(SMALL).fit(backwards, starts, 0).to_map().q_rad.tobytes()
    assert fitted.tobytes() != GammaSom(SMALL).fit(samples, starts, 1).to_map().q_rad.tobytes()


def test_contexts_that_count_nothing_change_nothing() -> None:
    samples, starts = two_ways_through_one_point()
    maps = [
        GammaSom(GammaSomParameters(**{**vars(SMALL), "a_w": 1.0, "n_contexts": n_contexts})).fit(samples, starts, 0).to_map()
        for n_contexts in (0, 3)
    ]
    assert maps[0].q_rad.tobytes() == maps[1].q_rad.tobytes()


def test_the_map_goes_where_the_samples_go() -> None:
    samples, starts = two_ways_through_one_point()
    here, there = (GammaSom(SMALL).fit(samples + shift, starts, 0).to_map().q_rad for shift in (0.0, 3.0))
    np.testing.assert_allclose(here + 3.0, there, atol=1e-6)  # contexts begin at the mean of the samples, not at zero radians


def test_sigma_begins_as_wide_as_the_lattice_asks() -> None:
    assert GammaSomParameters.of(100, 100) == GammaSomParameters()
    assert GammaSomParameters.of(30, 50).sigma_start_steps == pytest.approx(9.0)
    assert GammaSomParameters.of(2, 2).sigma_start_steps == 1.0


@given(st.integers(0, 8), st.floats(0.01, 1.0))
def test_distance_weights_fall_and_sum_to_one(n_contexts: int, a_w: float) -> None:
    a = GammaSomParameters(n_contexts=n_contexts, a_w=a_w).distance_weights
    assert len(a) == n_contexts + 1
    assert a.sum() == pytest.approx(1.0)
    assert np.all(a >= 0.0)
    assert np.all(np.diff(a[1:]) <= 0.0)


@pytest.mark.parametrize(
    ("starts", "named"), [([], r"\(0,\)"), ([1, 3], "got 1"), ([0, 3, 3], "got 0 to 3"), ([0, 10], "below 10"), ([0.0, 3.0], "float64")]
)
def test_starts_that_make_no_sense_are_refused(starts: list[float], named: str) -> None:
    with pytest.raises(ValueError, match=named):
        GammaSom(SMALL).fit(ring(10), np.array(starts), 0)


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"columns": 0}, "100 x 0"),
        ({"n_neighbours": 5}, "got 5"),
        ({"n_contexts": -1}, "got -1"),
        ({"epochs": 0}, "and 0"),
        ({"beta": 1.0}, r"got 1\.0"),
        ({"a_w": 0.0}, r"got 0\.0"),
        ({"rate_end": 0.5}, r"to 0\.5"),
        ({"sigma_end_steps": 0.0}, r"to 0\.0"),
    ],
)
def test_parameters_that_make_no_sense_are_refused(wrong: dict[str, float], named: str) -> None:
    with pytest.raises(ValueError, match=named):
        GammaSomParameters(**wrong)


def test_winners_are_asked_of_a_fitted_model_and_for_its_joints() -> None:
    with pytest.raises(ValueError, match="not fitted"):
        GammaSom(SMALL).winners(ring(10), np.zeros(1, dtype=np.int64))
    samples, starts = two_ways_through_one_point()
    with pytest.raises(ValueError, match="3 joints"):
        GammaSom(SMALL).fit(samples, starts, 0).winners(ring(10, n_joints=3), np.zeros(1, dtype=np.int64))
