"""What a path adds to a map, and which paths are refused."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from common.errors import RequestError
from services.planner.core.cognitive_map import CognitiveMap, components
from services.planner.core.growth import Addition
from services.planner.core.learning import LearningRules, check_path, learn, usual_spacing
from services.planner.core.lookup import LookupTable
from services.planner.core.roadmap import Roadmap
from services.planner.core.world import no_cells

RULES = LearningRules(spacing_rad=0.1, reuse_rad=0.05, join_neighbours=2, join_max_rad=1.0, max_neurons=100)
NO_TABLE = LookupTable(
    np.zeros(2, dtype=np.int64), np.empty(0, np.uint16), np.zeros(2, dtype=np.int64), np.empty(0, np.uint16), np.empty(0, np.int32)
)


def flat(q: list[list[float]], edges: list[list[int]]) -> Roadmap:
    """A map in the plane; the table does not matter here."""
    return Roadmap.of(CognitiveMap.of(np.array(q, dtype=float), np.array(edges).reshape(-1, 2)), NO_TABLE, "gng")


LINE = flat([[0.1 * k, 0.0] for k in range(11)], [[k, k + 1] for k in range(10)])


def everything(a: np.ndarray, b: np.ndarray) -> bool:
    return True


def whole(roadmap: Roadmap, addition: Addition) -> bool:
    n = roadmap.n_neurons + len(addition.neurons_rad)
    return int(components(n, np.vstack([roadmap.edges, addition.edges])).max()) == 0


def test_a_path_on_the_map_adds_nothing():
    assert learn(LINE, np.array([[0.0, 0.0], [1.0, 0.0]]), RULES, everything).is_empty


def test_a_path_near_the_map_uses_its_neurons():
    assert learn(LINE, np.array([[0.0, 0.04], [1.0, 0.04]]), RULES, everything).is_empty
    assert len(learn(LINE, np.array([[0.0, 0.06], [1.0, 0.06]]), RULES, everything).neurons_rad) == 11


def test_a_path_away_from_the_map_is_resampled_and_joined():
    path = np.array([[1.0, 0.0], [1.0, 0.5], [1.3, 0.5]])
    addition = learn(LINE, path, RULES, everything)
    assert len(addition.neurons_rad) == 8  # 0.8 rad at 0.1 rad; the first point is neuron 10
    np.testing.assert_allclose(addition.neurons_rad[[0, 4, 7]], [[1.0, 0.1], [1.0, 0.5], [1.3, 0.5]])
    pairs = set(map(tuple, addition.edges.tolist()))
    assert {(10, 11), *((k, k + 1) for k in range(11, 18))} <= pairs
    assert all(a < b for a, b in pairs) and len(pairs) == len(addition.edges)
    assert not pairs & set(map(tuple, LINE.edges.tolist()))
    assert whole(LINE, addition)


def test_new_neurons_join_their_nearest_only_where_it_is_free():
    def wall(a: np.ndarray, b: np.ndarray) -> bool:
        """Nothing passes y = 0.25 but at x = 1."""
        return not ((a[1] - 0.25) * (b[1] - 0.25) < 0.0 and (abs(a[0] - 1.0) > 1e-9 or abs(b[0] - 1.0) > 1e-9))

    addition = learn(LINE, np.array([[1.0, 0.0], [1.0, 0.3], [0.0, 0.3]]), RULES, wall)
    q = np.vstack([LINE.neurons_rad, addition.neurons_rad])
    assert all(wall(q[a], q[b]) for a, b in addition.edges)
    assert whole(LINE, addition)


def test_a_neuron_that_cannot_be_reached_does_not_stand_for_the_path():
    wall = 0.02  # just beside the map: its neurons are near, but there is no way to them before x = 1.05

    def is_free(a: np.ndarray, b: np.ndarray) -> bool:
        return (a[1] - wall) * (b[1] - wall) > 0.0 or max(a[0], b[0]) > 1.05

    addition = learn(LINE, np.array([[0.0, 0.04], [1.3, 0.04]]), RULES, is_free)
    assert len(addition.neurons_rad) == 14
    assert whole(LINE, addition)


def test_a_bend_that_a_step_would_cut_is_walked_in_smaller_steps():
    corner = np.array([1.0, 0.05])

    def is_free(a: np.ndarray, b: np.ndarray) -> bool:
        """A thorn in the inner corner: chords must stay on the two legs."""
        on_leg = [abs(q[0] - corner[0]) < 1e-9 or q[1] >= corner[1] - 1e-9 for q in (a, b)]
        same = abs(a[0] - b[0]) < 1e-9 or abs(a[1] - b[1]) < 1e-9
        return all(on_leg) and (same or (a[1] < 0.01 and b[1] < 0.01))

    addition = learn(LINE, np.array([[1.0, 0.0], [1.0, 0.05], [1.35, 0.05]]), RULES, is_free)
    assert np.any(np.all(np.isclose(addition.neurons_rad, corner), axis=1))


def test_the_same_path_twice_adds_nothing_the_second_time():
    path = np.array([[1.0, 0.0], [1.0, 0.5]])
    first = learn(LINE, path, RULES, everything)
    larger = Roadmap.of(
        CognitiveMap(np.vstack([LINE.neurons_rad, first.neurons_rad]), np.vstack([LINE.edges, first.edges])), NO_TABLE, "gng"
    )
    assert learn(larger, path, RULES, everything).is_empty


def test_learning_is_deterministic():
    path = np.cumsum(np.random.default_rng(2).normal(scale=0.1, size=(30, 2)), axis=0)
    one, two = (learn(LINE, path, RULES, everything) for _ in range(2))
    assert one.neurons_rad.tobytes() == two.neurons_rad.tobytes() and one.edges.tobytes() == two.edges.tobytes()


def test_an_island_is_refused():
    with pytest.raises(RequestError) as caught:
        learn(LINE, np.array([[5.0, 5.0], [5.0, 6.0]]), RULES, everything)
    assert caught.value.code == "not_joined" and caught.value.facts["distance_rad"] == pytest.approx(np.hypot(4, 5))


def test_an_island_is_taken_in_where_there_is_no_other_way():
    """What repair and the fallback found: an arm that is there already needs no way from the rest of the map."""
    exactly = LearningRules(0.1, 0.05, 2, 1.0, max_neurons=100, exactly=True)
    addition = learn(LINE, np.array([[5.0, 5.0], [5.0, 6.0]]), exactly, everything)
    assert len(addition.neurons_rad) == 11 and not whole(LINE, addition)
    assert set(np.unique(addition.edges)) == set(range(11, 22))


EXACTLY = LearningRules(0.1, 0.05, 2, 1.0, max_neurons=1000, exactly=True)
LANE = np.array([[0.0, 0.5], [1.0, 0.5]])


def test_a_narrow_place_is_walked_in_steps_that_are_free_among_the_cells_there():
    def among_cells(a: np.ndarray, b: np.ndarray) -> bool:
        """Between x = 0.4 and 0.6 a look at a long step falls on what is in the way; short steps pass between two looks."""
        return max(a[0], b[0]) <= 0.4 + 1e-9 or min(a[0], b[0]) >= 0.6 - 1e-9 or abs(b[0] - a[0]) < 0.03

    addition = learn(LINE, LANE, EXACTLY, everything, among_cells)
    q, n = addition.neurons_rad, LINE.n_neurons
    along = np.argsort(q[:, 0])
    pairs = {tuple(sorted((int(a), int(b)))) for a, b in zip(along[:-1] + n, along[1:] + n, strict=True)}
    assert pairs <= set(map(tuple, addition.edges.tolist())), "the whole way is in the map"
    assert all(among_cells(q[a], q[b]) for a, b in pairwise(along))
    assert 11 < len(q) < 30, "small steps only where they are needed"


def test_a_way_is_learned_though_the_cells_have_changed_since():
    addition = learn(LINE, LANE, EXACTLY, everything, lambda _a, _b: False)
    assert len(addition.neurons_rad) == 1 + 10 * 32, "in the smallest steps, of which no more is asked than of any edge"


def test_growth_is_bounded():
    few = LearningRules(0.1, 0.05, 2, 1.0, max_neurons=3)
    with pytest.raises(RequestError) as caught:
        learn(LINE, np.array([[1.0, 0.0], [1.0, 0.5]]), few, everything)
    assert caught.value.code == "too_long" and "3" in caught.value.message


def test_the_usual_spacing_is_the_median_edge():
    assert usual_spacing(CognitiveMap.of(LINE.neurons_rad, LINE.edges)) == pytest.approx(0.1)
    assert usual_spacing(CognitiveMap(LINE.neurons_rad, np.empty((0, 2), np.int32))) == np.inf


HOME = np.array([0.0, -1.5708, 1.5708, -1.5708, -1.5708, 0.0])
IN_TABLE = np.array([0.0, 0.6, 0.3, 0.0, 0.0, 0.0])


def from_home(*by_rad: float) -> np.ndarray:
    return HOME + np.pad(np.array(by_rad), (0, 6 - len(by_rad)))


def changed(row: int, column: int, value: float) -> np.ndarray:
    q = np.linspace(HOME, HOME + 0.1, 5)
    q[row, column] = value
    return q


@pytest.mark.parametrize(
    ("q", "code", "words"),
    [
        (np.zeros((5, 5)), "bad_shape", ["[5, 5]"]),
        (np.zeros(6), "bad_shape", ["[6]"]),
        (np.array([HOME]), "bad_shape", ["[1, 6]"]),
        (np.empty((0, 6)), "bad_shape", ["[0, 6]"]),
        (np.array([HOME] * 4), "no_motion", ["4 samples"]),
        (changed(3, 2, np.nan), "out_of_limits", ["q_rad[3]", "elbow_joint", "nan"]),
        (changed(0, 5, np.inf), "out_of_limits", ["q_rad[0]", "wrist_3_joint", "inf"]),
        (changed(4, 1, 9.0), "out_of_limits", ["q_rad[4]", "shoulder_lift_joint", "9 rad"]),
        (np.array([HOME, HOME + 0.01, IN_TABLE]), "in_collision", ["sample 1 to 2"]),
        (np.array([IN_TABLE, HOME]), "in_collision", ["q_rad[0]", "table"]),
        (np.array([HOME, from_home(0, 0, 1.43)]), "in_collision", ["touch itself"]),
    ],
)
def test_impossible_paths_are_refused_by_place_and_value(bench, q, code, words):
    with pytest.raises(RequestError) as caught:
        check_path(q, bench.robot, bench.checker, no_cells(bench.grid))
    assert caught.value.code == code
    for word in words:
        assert word in caught.value.message


def test_a_jump_is_judged_by_the_straight_way(bench):
    free = check_path(np.array([HOME, from_home(1.2)]), bench.robot, bench.checker, no_cells(bench.grid))
    assert len(free) == 2
    through = np.array([from_home(-1.2, 0.9), from_home(1.2, 0.9)])  # low over the table, bins between
    with pytest.raises(RequestError, match=r"of the way from sample 0 to 1|q_rad\[0\]"):
        check_path(through, bench.robot, bench.checker, no_cells(bench.grid))


def test_rests_are_left_out(bench):
    q = np.repeat(np.linspace(HOME, HOME + 0.1, 4), 3, axis=0)
    assert len(check_path(q, bench.robot, bench.checker, no_cells(bench.grid))) == 4


def test_a_path_that_is_taken_exactly_keeps_its_corners_and_uses_no_neuron_nearby():
    rules = LearningRules(spacing_rad=0.4, reuse_rad=0.2, join_neighbours=2, join_max_rad=1.0, max_neurons=100, exactly=True)
    path = np.array([[0.0, 0.0], [0.3, 0.04], [0.35, 0.5], [1.0, 0.04], [1.0, 0.0]])
    addition = learn(LINE, path, rules, everything)
    known = np.vstack([LINE.neurons_rad, addition.neurons_rad])
    at = [int(np.flatnonzero((known == q).all(axis=1))[0]) for q in path]
    assert (at[0], at[-1]) == (0, 10), "the points that are neurons already"
    assert min(at[1:-1]) >= LINE.n_neurons
    joined = {tuple(sorted(edge)) for edge in addition.edges.tolist()}
    steps = np.linalg.norm(known[addition.edges[:, 0]] - known[addition.edges[:, 1]], axis=1)
    assert {(0, at[1]), (10, at[3])} <= joined and steps.min() <= rules.spacing_rad
    assert len(addition.neurons_rad) == 1 + 2 + 2, "0.46 and 0.80 rad in steps of 0.4 rad at most"
