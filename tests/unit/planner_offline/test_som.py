from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.planner.core.cognitive_map import CognitiveMap, quantisation_error_rad, topographic_error
from services.planner.core.lattice import lattice_edges, lattice_of, principal_plane
from services.planner.core.som import SelfOrganisingMap, SomParameters
from services.planner.kernels import som as kernel
from tests.support import slow_som
from tests.support.joint_samples import ring, square

NO_STARTS = np.zeros(1, dtype=np.int64)
SHAPE = (9, 14)  # no multiples of kernel.TILE
SMALL = SomParameters(rows=12, columns=10, radius_start_steps=3.0, radius_middle_steps=1.5, epochs_rough=3, epochs_fine=6)
IN_SEQUENCE = replace(SMALL, training="sequential", signals_per_unit=200)


def begun(samples: np.ndarray, shape: tuple[int, int] = SHAPE) -> kernel.Lattice:
    return lattice_of(principal_plane(samples, *shape), np.ones(samples.shape[1]), *shape)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 7), st.integers(1, 13), st.integers(2, 13))
def test_nearest_equals_brute_force_whatever_the_hint(seed: int, n: int, rows: int, columns: int) -> None:
    rng = np.random.default_rng(seed)
    vector = np.round(rng.normal(size=(rows * columns, n)), 1)  # rounded: plenty of equal distances
    coefficient = np.round(rng.uniform(size=n), 1)  # some of them 0
    lattice = lattice_of(vector, coefficient, rows, columns)
    for x in np.concatenate([np.round(rng.normal(size=(20, n)), 1), 5.0 * rng.normal(size=(5, n)), vector[:3]]):
        assert kernel.nearest(lattice, x, int(rng.integers(rows * columns))) == slow_som.winner_of(vector, coefficient, x)


def test_sequential_kernel_equals_its_slow_twin() -> None:
    samples = ring(300)
    rng = np.random.default_rng(3)
    order = rng.integers(len(samples), size=1500)
    rate, spread = np.linspace(0.5, 0.02, len(order)), np.linspace(18.0, 0.5, len(order))
    lattice, winner = begun(samples), np.zeros(len(samples), dtype=np.int32)
    slow = lattice.vector.copy()
    expected = slow_som.present(slow, SHAPE, samples[order], rate, spread, kernel.CUT)
    kernel.present(lattice, samples, order, rate, spread, winner)
    last = dict(zip(order.tolist(), expected, strict=True))
    assert {sample: int(winner[sample]) for sample in last} == last
    np.testing.assert_allclose(lattice.vector, slow, rtol=0, atol=1e-12)


def test_what_the_window_cuts_off_hardly_moves_the_map() -> None:
    samples = square(400)
    order = np.random.default_rng(3).integers(len(samples), size=2000)
    rate, spread = np.linspace(0.5, 0.02, len(order)), np.linspace(8.0, 1.0, len(order))
    cut, whole = begun(samples).vector.copy(), begun(samples).vector.copy()
    slow_som.present(cut, SHAPE, samples[order], rate, spread, kernel.CUT)
    slow_som.present(whole, SHAPE, samples[order], rate, spread, np.inf)
    spacing = np.mean(np.linalg.norm(np.diff(whole.reshape(*SHAPE, -1), axis=1), axis=2))
    assert np.linalg.norm(cut - whole, axis=1).max() < 0.05 * spacing


@pytest.mark.parametrize("radius_steps", [3.0, 1.0, 0.4])
def test_batch_epochs_equal_their_slow_twin(radius_steps: float) -> None:
    samples = ring(500)
    lattice, winner = begun(samples), np.zeros(len(samples), dtype=np.int32)
    total = np.zeros((len(lattice.vector), samples.shape[1] + 1))
    for _ in range(3):
        # each epoch from the same units: with a small radius, units that win nothing become copies of one that does, but for rounding
        expected = slow_som.batch_epoch(lattice.vector, SHAPE, samples, 2.0 * radius_steps**2, kernel.FAINT)
        kernel.assign(lattice, samples, winner, total)
        assert winner.tolist() == [slow_som.winner_of(lattice.vector, lattice.coefficient, x) for x in samples]
        kernel.smooth(lattice, total, np.zeros_like(total), 2.0 * radius_steps**2)
        np.testing.assert_allclose(lattice.vector, expected, rtol=0, atol=1e-12)


def test_a_unit_that_no_sample_reaches_stays_where_it_is() -> None:
    lattice = lattice_of(np.arange(200.0)[:, None], np.ones(1), 1, 200)
    samples, winner, total = np.full((5, 1), 2.4), np.zeros(5, dtype=np.int32), np.zeros((200, 2))
    kernel.assign(lattice, samples, winner, total)
    kernel.smooth(lattice, total, np.zeros_like(total), 2.0)
    assert winner.tolist() == [2] * 5
    np.testing.assert_allclose(lattice.vector[:20, 0], 2.4)
    np.testing.assert_array_equal(lattice.vector[50:, 0], np.arange(50.0, 200.0))


def test_a_sequential_fit_follows_the_schedules_of_the_toolbox() -> None:
    samples = ring(200)
    p = SomParameters(
        rows=5, columns=6, training="sequential", radius_start_steps=2.0, radius_middle_steps=1.2, radius_end_steps=0.8, signals_per_unit=20
    )
    rng = np.random.default_rng(8)
    slow = principal_plane(samples, 5, 6)
    for n, rate_start, first, last in ((120, 0.5, 2.0, 1.2), (480, 0.05, 1.2, 0.8)):  # 600 signals, 2 : 8 as the epochs
        t = np.arange(n)
        b = (n - 1) / 99
        rate, radius = b * rate_start / (b + t), np.linspace(first, last, n)
        slow_som.present(slow, (5, 6), samples[rng.integers(len(samples), size=n)], rate, 2 * radius**2, kernel.CUT)
    fitted = SelfOrganisingMap(p).fit(samples, NO_STARTS, 8).to_map()
    np.testing.assert_allclose(fitted.q_rad, slow, rtol=0, atol=1e-12)


@pytest.mark.parametrize("parameters", [SMALL, IN_SEQUENCE], ids=["batch", "sequential"])
def test_a_lattice_unfolds_on_a_square(parameters: SomParameters) -> None:
    samples = square(3000)
    begun_rad = quantisation_error_rad(CognitiveMap.of(principal_plane(samples, 12, 10), np.empty((0, 2), dtype=np.int64)), samples)
    fitted = SelfOrganisingMap(parameters).fit(samples, NO_STARTS, 0).to_map()
    assert quantisation_error_rad(fitted, samples) < 0.6 * begun_rad
    assert topographic_error(fitted, samples) < 0.03
    assert fitted.edge_length_rad.max() < 0.2


def test_batch_training_does_not_depend_on_the_seed_and_sequential_does() -> None:
    samples = ring(500)
    batch, sequential = (
        [SelfOrganisingMap(p).fit(samples, NO_STARTS, seed).to_map().q_rad for seed in (0, 1)] for p in (SMALL, IN_SEQUENCE)
    )
    assert batch[0].tobytes() == batch[1].tobytes()
    assert sequential[0].tobytes() != sequential[1].tobytes()


def test_default_parameters_are_the_toolbox_s_for_the_paper_s_lattice() -> None:
    assert SomParameters.of(100, 100, 50_728) == SomParameters.of(100, 100, 50_000) == SomParameters()
    tiny = SomParameters.of(4, 5, 1000)
    assert (tiny.radius_start_steps, tiny.radius_middle_steps, tiny.epochs_rough, tiny.epochs_fine) == (1.0, 1.0, 1, 1)


def test_the_plane_reaches_one_deviation_along_the_two_largest_components() -> None:
    rng = np.random.default_rng(4)
    samples = rng.normal(size=(5000, 3)) * [0.1, 3.0, 1.0] + [5.0, 6.0, 7.0]
    for shape in ((7, 4), (4, 7)):
        grid = principal_plane(samples, *shape).reshape(*shape, 3)
        longer, shorter = (grid[-1, 0] - grid[0, 0], grid[0, -1] - grid[0, 0])[:: 1 if shape[0] > shape[1] else -1]
        np.testing.assert_allclose(np.abs(longer), [0.0, 6.0, 0.0], atol=0.15)
        np.testing.assert_allclose(np.abs(shorter), [0.0, 0.0, 2.0], atol=0.15)
        np.testing.assert_allclose(grid.mean(axis=(0, 1)), samples.mean(axis=0), atol=1e-9)


@pytest.mark.parametrize("parameters", [SMALL, IN_SEQUENCE], ids=["batch", "sequential"])
def test_samples_on_a_line_give_a_folded_but_valid_map(parameters: SomParameters) -> None:
    line = np.linspace(0, 1, 300)[:, None] * [1.0, 2.0]
    fitted = SelfOrganisingMap(parameters).fit(line, NO_STARTS, 0).to_map()
    np.testing.assert_allclose(fitted.q_rad[:, 1], 2.0 * fitted.q_rad[:, 0], atol=1e-8)
    assert quantisation_error_rad(fitted, line) < 0.1


def test_a_chain_of_units_learns_one_joint() -> None:
    samples = np.random.default_rng(0).uniform(size=(500, 1))
    chain = SelfOrganisingMap(SomParameters.of(1, 20, 500)).fit(samples, NO_STARTS, 0).to_map()
    assert len(chain.edges) == 19
    assert quantisation_error_rad(chain, samples) < 0.03
    assert np.all(np.diff(chain.q_rad[:, 0]) > 0)


@pytest.mark.parametrize(("n_neighbours", "corner", "side", "inside"), [(4, 2, 3, 4), (8, 3, 5, 8)])
def test_edges_are_those_of_the_lattice(n_neighbours: int, corner: int, side: int, inside: int) -> None:
    rows, columns = 4, 5
    edges = CognitiveMap.of(np.zeros((20, 1)), lattice_edges(rows, columns, n_neighbours)).edges
    degree = np.bincount(edges.ravel(), minlength=20).reshape(rows, columns)
    expected = np.full((rows, columns), inside)
    expected[[0, -1]] = expected[:, [0, -1]] = side
    expected[[0, 0, -1, -1], [0, -1, 0, -1]] = corner
    np.testing.assert_array_equal(degree, expected)
    steps = [slow_som.squared_steps((rows, columns), a)[b] for a, b in edges]
    assert set(steps) == ({1} if n_neighbours == 4 else {1, 2})


def test_quality_equals_brute_force() -> None:
    rng = np.random.default_rng(6)
    samples = rng.normal(size=(200, 3))
    cognitive_map = CognitiveMap.of(rng.normal(size=(30, 3)), lattice_edges(5, 6, 4))
    distance = np.linalg.norm(samples[:, None] - cognitive_map.q_rad[None], axis=2)
    joined = {frozenset(edge) for edge in cognitive_map.edges.tolist()}
    apart = [frozenset(pair) not in joined for pair in np.argsort(distance, axis=1)[:, :2].tolist()]
    assert quantisation_error_rad(cognitive_map, samples) == pytest.approx(distance.min(axis=1).mean())
    assert 0.0 < topographic_error(cognitive_map, samples) == pytest.approx(np.mean(apart))


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"rows": 0}, "0 x 100"),
        ({"rows": 1, "columns": 1}, "1 x 1"),
        ({"n_neighbours": 6}, "got 6"),
        ({"training": "online"}, "online"),
        ({"radius_middle_steps": 20.0}, r"20\.0"),
        ({"radius_end_steps": 0.0}, r"0\.0"),
        ({"epochs_fine": 0}, r"\(2, 0, 500\)"),
        ({"rate_rough": 1.5}, r"1\.5"),
    ],
)
def test_parameters_that_make_no_sense_are_refused(wrong: dict[str, object], named: str) -> None:
    with pytest.raises(ValueError, match=named):
        SomParameters(**wrong)
