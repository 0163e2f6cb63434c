"""What holds for every model of the map: growing neural gas, SOM, gamma-SOM."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from services.planner.core.gamma_som import GammaSom, GammaSomParameters
from services.planner.core.gng import GasParameters, GrowingNeuralGas
from services.planner.core.models import MapModel
from services.planner.core.som import SelfOrganisingMap, SomParameters
from tests.support.joint_samples import ring

MODELS: dict[str, Callable[[], MapModel]] = {
    "gng": lambda: GrowingNeuralGas(GasParameters(insert_every=20), 100),
    "som": lambda: SelfOrganisingMap(SomParameters.of(10, 9, 800)),
    "som in sequence": lambda: SelfOrganisingMap(SomParameters.of(10, 9, 800, "sequential", n_neighbours=4)),
    "gamma-som": lambda: GammaSom(GammaSomParameters(rows=10, columns=9, epochs=4, sigma_start_steps=3.0)),
}
LATTICES = [name for name in MODELS if name != "gng"]
SAMPLES = ring(800)
STARTS = np.arange(0, 800, 40)


@pytest.fixture(params=MODELS)
def model(request: pytest.FixtureRequest) -> MapModel:
    return MODELS[request.param]()


def test_fit_returns_the_model_and_reports_how_far_it_is(model: MapModel) -> None:
    shares: list[float] = []
    assert model.fit(SAMPLES, STARTS, 0, shares.append) is model
    assert shares == sorted(shares)
    assert 0.0 < shares[0] <= shares[-1] == pytest.approx(1.0)


@pytest.mark.parametrize("make", MODELS.values(), ids=MODELS)
def test_same_samples_and_seed_give_the_same_bytes(make: Callable[[], MapModel]) -> None:
    kept = SAMPLES.copy()
    first, second = (make().fit(SAMPLES, STARTS, 5).to_map() for _ in range(2))
    assert first.q_rad.tobytes() == second.q_rad.tobytes()
    assert first.edges.tobytes() == second.edges.tobytes()
    assert SAMPLES.tobytes() == kept.tobytes(), "the samples were changed"


def test_a_second_fit_begins_anew(model: MapModel) -> None:
    alone = model.fit(SAMPLES, STARTS, 5).to_map().q_rad.copy()
    model.fit(SAMPLES[::-1], STARTS, 6)
    assert model.fit(SAMPLES, STARTS, 5).to_map().q_rad.tobytes() == alone.tobytes()


def test_the_map_is_whole(model: MapModel) -> None:
    learned = model.fit(SAMPLES, STARTS, 0).to_map()
    n = learned.n_neurons
    assert learned.q_rad.shape == (n, 6)
    assert learned.q_rad.dtype == np.float64
    assert learned.edges.dtype == np.int32
    assert np.all(np.isfinite(learned.q_rad))
    assert np.all((learned.q_rad >= SAMPLES.min(axis=0)) & (learned.q_rad <= SAMPLES.max(axis=0)))
    assert np.all(learned.edges[:, 0] < learned.edges[:, 1])
    assert learned.edges.max() < n
    assert len(np.unique(learned.edges, axis=0)) == len(learned.edges)
    assert np.bincount(learned.edges.ravel(), minlength=n).min() >= 1
    np.testing.assert_array_equal(learned.edges, learned.edges[np.lexsort(learned.edges.T[::-1])])


@pytest.mark.parametrize(("name", "n_edges"), [("som", 9 * 9 + 10 * 8 + 2 * 9 * 8), ("som in sequence", 9 * 9 + 10 * 8)])
def test_a_lattice_keeps_all_its_units_and_edges(name: str, n_edges: int) -> None:
    learned = MODELS[name]().fit(SAMPLES, STARTS, 0).to_map()
    assert (learned.n_neurons, len(learned.edges)) == (90, n_edges)


def test_best_match_equals_brute_force_over_the_map(model: MapModel) -> None:
    learned = model.fit(SAMPLES, STARTS, 0).to_map()
    for q in ring(100, seed=9):
        assert model.best_match(q) == np.argmin(np.sum((learned.q_rad - q) ** 2, axis=1))


def test_what_is_not_fitted_answers_nothing(model: MapModel) -> None:
    with pytest.raises(ValueError, match="not fitted"):
        model.to_map()
    with pytest.raises(ValueError, match="not fitted"):
        model.best_match(np.zeros(6))


@pytest.mark.parametrize(
    "samples",
    [np.zeros((1, 6)), np.zeros(6), np.zeros((5, 0)), np.full((5, 6), np.nan), np.ones((9, 6))],
    ids=["one", "flat", "no joint", "nan", "all the same"],
)
def test_useless_samples_are_refused(model: MapModel, samples: np.ndarray) -> None:
    with pytest.raises(ValueError, match="samples"):
        model.fit(samples, np.zeros(1, dtype=np.int64), 0)


@pytest.mark.parametrize("name", LATTICES)
def test_a_lattice_cannot_be_extended(name: str) -> None:
    fitted = MODELS[name]().fit(SAMPLES, STARTS, 0)
    before = fitted.to_map().q_rad.copy()
    with pytest.raises(ValueError, match="10 x 9 units has a fixed size and cannot be extended"):
        fitted.partial_fit(SAMPLES, 1)
    np.testing.assert_array_equal(fitted.to_map().q_rad, before)
