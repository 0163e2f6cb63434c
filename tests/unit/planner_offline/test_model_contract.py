"""What holds for every model of the map: growing neural gas, SOM, gamma-SOM."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from common.geometry.grid import Grid
from services.planner.core.gamma_som import GammaSom, GammaSomParameters
from services.planner.core.gng import GasParameters, GrowingNeuralGas
from services.planner.core.lookup import LookupTable, build_table
from services.planner.core.models import MapModel
from services.planner.core.som import SelfOrganisingMap, SomParameters
from services.planner.kernels.moves import segment_steps
from services.planner.offline.scene import Scene
from tests.support.joint_samples import ring
from tests.support.slow_planner import slow_pose_cells

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


COARSE = Grid((-0.8, -0.8, 0.0), (40, 40, 25), 0.04)  # coarse enough to ask every cell about every body
SAFETY_M, STEP_M = 0.02, 0.02


def swept(scene: Scene, q_rad: np.ndarray) -> tuple[set[int], set[int]]:
    """The cells that block a pose, by asking each cell of the grid about each body; and those of them that may be missing.

    These lie farther from the boxes around all bodies than a cell that touches can: only the rounding of the distance grids, up to a voxel
    and always towards the arm, makes them touch. The table looks at boxes first and need not list them.
    """
    frames = scene.robot.joint_poses(q_rad[None])[0]
    half_m, grids = COARSE.resolution_m / 2, scene.arm.grids
    cells = np.flatnonzero(slow_pose_cells(scene.arm, frames, COARSE.centres(np.arange(COARSE.n_cells)), half_m, SAFETY_M))
    away_m = np.full(len(cells), np.inf)
    for body in np.flatnonzero(scene.arm.moving):
        frame = frames[grids.body_joint[body]]
        inside = (COARSE.centres(cells) - frame[:3, 3]) @ frame[:3, :3]
        beyond = np.maximum(np.maximum(grids.box_min_m[body] - inside, inside - grids.box_max_m[body]), 0.0)
        away_m = np.minimum(away_m, np.linalg.norm(beyond, axis=1))
    return set(cells.tolist()), set(cells[away_m > SAFETY_M + half_m * np.sqrt(3.0)].tolist())


def rows_of(table: LookupTable, what: str, owner: int) -> set[int]:
    row = table.neurons_of if what == "neurons" else table.edges_of
    return {cell for cell in range(COARSE.n_cells) if owner in row(cell)}


def test_the_table_equals_brute_force(model: MapModel, scene: Scene) -> None:
    learned = model.fit(SAMPLES, STARTS, 0).to_map()
    table = build_table(scene.arm, COARSE, learned.q_rad, learned.edges, safety_m=SAFETY_M, step_m=STEP_M)
    unavoidable = set(table.unavoidable.tolist())
    for neuron in range(0, learned.n_neurons, 30):
        cells, doubtful = swept(scene, learned.q_rad[neuron])
        assert rows_of(table, "neurons", neuron) | unavoidable | doubtful == cells | unavoidable | doubtful
        assert len(doubtful) < 0.05 * len(cells)
    rotation, translation = np.empty((2, 7, 3, 3)), np.empty((2, 7, 3))
    n_cells = 0
    for edge in np.argsort(-learned.edge_length_rad, kind="stable")[[0, len(learned.edges) // 2]]:  # the longest, and an ordinary one
        a, b = learned.q_rad[learned.edges[edge]]
        n_steps = segment_steps(scene.arm, a, b - a, STEP_M, rotation, translation)
        poses = [swept(scene, a + (b - a) * step / n_steps) for step in range(n_steps + 1)]
        between = set().union(*(cells for cells, _ in poses[1:-1]))
        doubtful = set().union(*(cells for _, cells in poses))
        beyond_ends = between - poses[0][0] - poses[-1][0] - unavoidable
        assert rows_of(table, "edges", int(edge)) | doubtful == beyond_ends | doubtful
        n_cells += len(beyond_ends - doubtful)
    assert n_cells > 0, "no edge swept anything: the case tests too little"
