from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.planner.core import gng
from services.planner.core.cognitive_map import statistics
from services.planner.core.gng import GasParameters, GrowingNeuralGas
from services.planner.kernels import gas as units
from services.planner.kernels import gng as kernel
from tests.support.joint_samples import ring
from tests.support.slow_gng import SlowGas

NO_STARTS = np.zeros(1, dtype=np.int64)


def shown_to_both(samples: np.ndarray, order: np.ndarray, p: GasParameters, n_target: int) -> tuple[units.Gas, SlowGas]:
    fast = gng._empty_gas(samples, n_target)
    for index in (0, 1):
        units.add_unit(fast, samples[index], 0.0)
    kernel.connect(fast, 0, 1, 0)
    slow = SlowGas(samples[0], samples[1])
    kernel.present(fast, samples, order, n_target, p.insert_every, p.e_best, p.e_neighbour, p.alpha, p.decay, p.max_age)
    for index in order:
        if len(slow.weight) >= n_target:
            break
        slow.show(samples[index], p.insert_every, p.e_best, p.e_neighbour, p.alpha, p.decay, p.max_age)
    return fast, slow


def edges_of(gas: units.Gas) -> dict[frozenset[int], int]:
    n = gas.counts[units.N_SLOTS]
    return {frozenset((u, int(gas.neighbour[u, k]))): int(gas.age[u, k]) for u in range(n) for k in range(max(gas.degree[u], 0))}


@pytest.mark.parametrize("max_age", [3, 50])  # 3: edges and units die often
def test_kernel_equals_its_slow_twin(max_age: int) -> None:
    samples = ring(400)
    order = np.random.default_rng(7).integers(len(samples), size=6000)
    p = GasParameters(insert_every=20, max_age=max_age, decay=0.999)
    fast, slow = shown_to_both(samples, order, p, 260)  # more than FEW_UNITS: the buckets are in use
    n_inserted = fast.counts[units.N_SIGNALS] // p.insert_every
    if max_age == 3:
        assert fast.counts[units.N_ALIVE] < 2 + n_inserted, "no unit ever died: the case tests too little"
    else:
        assert fast.counts[units.N_ALIVE] > units.FEW_UNITS
    for step in ("grown", "refreshed"):
        alive = [u for u in range(fast.counts[units.N_SLOTS]) if fast.degree[u] >= 0]
        assert alive == sorted(slow.weight), step
        np.testing.assert_allclose(fast.weight[alive], [slow.weight[u] for u in alive], rtol=0, atol=1e-12)
        assert edges_of(fast) == slow.age, step
        np.testing.assert_allclose(fast.error[alive] * fast.error_scale[0], [slow.error[u] for u in alive], rtol=1e-9)
        kernel.refresh(fast, samples)
        slow.refresh(samples)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 7))
def test_nearest_two_equal_brute_force_anywhere(seed: int, n_joints: int) -> None:
    rng = np.random.default_rng(seed)
    weights = np.round(rng.normal(size=(1500, n_joints)), 1)  # rounded: plenty of equal distances and of units on bucket borders
    gas = gng._empty_gas(weights[:700], 1500)  # buckets laid out for other data than they hold
    for w in weights:
        gas.degree[units.add_unit(gas, w, 0.0)] = 1
    for x in np.concatenate([np.round(rng.normal(size=(60, n_joints)), 1), 5.0 * rng.normal(size=(20, n_joints))]):
        difference = x - weights
        distance = np.zeros(len(weights))
        for j in range(n_joints):  # summed in the kernel's order: ties are exact
            distance += difference[:, j] ** 2
        best, second = np.argsort(distance, kind="stable")[:2]
        s1, d1, s2, d2 = units.nearest_two(gas, x)
        assert (s1, s2) == (best, second)
        assert (d1, d2) == (distance[best], distance[second])


def test_same_seed_same_bytes_and_other_seed_other_map() -> None:
    samples = ring(2000)
    maps = [GrowingNeuralGas(GasParameters(), 300).fit(samples, NO_STARTS, seed).to_map() for seed in (3, 3, 4)]
    assert maps[0].q_rad.tobytes() == maps[1].q_rad.tobytes() and maps[0].edges.tobytes() == maps[1].edges.tobytes()
    assert maps[0].q_rad.tobytes() != maps[2].q_rad.tobytes()


def test_buckets_make_the_map_that_a_scan_of_all_units_makes(monkeypatch: pytest.MonkeyPatch) -> None:
    """No direction tells samples apart: all units are in one bucket."""
    samples = ring(5000)
    bucketed = GrowingNeuralGas(GasParameters(), 1500).fit(samples, NO_STARTS, 5).to_map()
    monkeypatch.setattr(gng, "FLAT_RAD", np.inf)
    scanned = GrowingNeuralGas(GasParameters(), 1500).fit(samples, NO_STARTS, 5).to_map()
    assert bucketed.q_rad.tobytes() == scanned.q_rad.tobytes() and bucketed.edges.tobytes() == scanned.edges.tobytes()


def test_a_fitted_gas_covers_its_samples() -> None:
    samples = ring(5000)
    gas = GrowingNeuralGas(GasParameters(), 400).fit(samples, NO_STARTS, 0)
    figures = statistics(gas.to_map(), samples)
    coarse = statistics(GrowingNeuralGas(GasParameters(), 40).fit(samples, NO_STARTS, 0).to_map(), samples)
    assert figures.neurons >= 0.95 * 400
    assert figures.quantisation_error_rad < 0.04 < coarse.quantisation_error_rad
    assert figures.degree_quantiles[0] >= 1


def test_best_match_is_the_nearest_neuron_of_the_map() -> None:
    samples = ring(3000)
    gas = GrowingNeuralGas(GasParameters(), 300).fit(samples, NO_STARTS, 0)
    cognitive_map = gas.to_map()
    asked = ring(50, seed=9)
    np.testing.assert_array_equal([gas.best_match(q) for q in asked], cognitive_map.best_match(asked))


def test_partial_fit_learns_a_new_place_and_keeps_the_old() -> None:
    samples, elsewhere = ring(3000), ring(500) + 3.0
    gas = GrowingNeuralGas(GasParameters(), 300)
    gas.fit(samples, NO_STARTS, 0)
    before = statistics(gas.to_map(), elsewhere).quantisation_error_rad
    gas.partial_fit(elsewhere, seed=1, n_signals=4000)
    after = gas.to_map()
    assert statistics(after, elsewhere).quantisation_error_rad < 0.2 * before
    assert statistics(after, samples).quantisation_error_rad < 0.1


def test_a_gas_taken_up_again_from_its_map_is_that_map_and_learns_on() -> None:
    samples, elsewhere = ring(3000), ring(500) + 3.0
    kept = GrowingNeuralGas(GasParameters(), 300).fit(samples, NO_STARTS, 0).to_map()
    gas = GrowingNeuralGas.of_map(kept, GasParameters(), 360, elsewhere)
    again = gas.to_map()
    assert again.q_rad.tobytes() == kept.q_rad.tobytes() and again.edges.tobytes() == kept.edges.tobytes()
    asked = np.concatenate([ring(20, seed=9), elsewhere[:20]])
    np.testing.assert_array_equal([gas.best_match(q) for q in asked], kept.best_match(asked))
    learned = gas.partial_fit(elsewhere, seed=1, n_signals=9000).to_map()
    assert kept.n_neurons < learned.n_neurons <= 360
    assert statistics(learned, elsewhere).quantisation_error_rad < 0.05 * statistics(kept, elsewhere).quantisation_error_rad
    assert statistics(learned, samples).quantisation_error_rad < 2.0 * statistics(kept, samples).quantisation_error_rad


def test_a_gas_is_not_taken_up_with_less_room_or_another_width() -> None:
    kept = GrowingNeuralGas(GasParameters(), 100).fit(ring(1000), NO_STARTS, 0).to_map()
    with pytest.raises(ValueError, match="n_neurons is 50"):
        GrowingNeuralGas.of_map(kept, GasParameters(), 50, ring(100))
    with pytest.raises(ValueError, match="5 joints, the map has 6"):
        GrowingNeuralGas.of_map(kept, GasParameters(), 200, ring(100, n_joints=5))


def test_a_gas_of_one_joint_works() -> None:
    samples = np.linspace(0, 1, 500)[:, None]
    figures = statistics(GrowingNeuralGas(GasParameters(), 20).fit(samples, NO_STARTS, 0).to_map(), samples)
    assert figures.neurons >= 15
