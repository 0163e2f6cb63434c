"""A map comes out of the pipe as it went in, as the kernels want it."""

from __future__ import annotations

import msgspec
import numpy as np

from services.planner.core.two_trees import Known, no_map
from services.planner.fallback.carried_map import CarriedMap, pack, unpack


def _there_and_back(known: Known) -> Known:
    return unpack(msgspec.msgpack.decode(msgspec.msgpack.encode(pack(known)), type=CarriedMap), 6)


def _arrays(known: Known) -> list[np.ndarray]:
    return [*known.graph[:5], *known.graph.near, known.node_count, known.edge_count]


def test_it_comes_out_as_it_went_in(cut):
    roadmap = cut[0].roadmap
    drawn = np.random.default_rng(3)
    known = Known(roadmap.graph, *(drawn.integers(0, 3, size, dtype=np.int32) for size in (roadmap.n_neurons, roadmap.n_edges)))
    back = _there_and_back(known)
    zero_or_one = known._replace(node_count=(known.node_count > 0).astype(np.int32), edge_count=(known.edge_count > 0).astype(np.int32))
    for was, is_now in zip(_arrays(zero_or_one), _arrays(back), strict=True):
        np.testing.assert_array_equal(was, is_now)
        assert was.dtype == is_now.dtype
        assert is_now.flags.writeable and is_now.flags.c_contiguous, "another type would be compiled for"


def test_so_does_the_empty_one():
    for was, is_now in zip(_arrays(no_map(6)), _arrays(_there_and_back(no_map(6))), strict=True):
        np.testing.assert_array_equal(was, is_now)
        assert was.dtype == is_now.dtype and was.shape == is_now.shape


def test_a_graph_that_came_before_is_not_built_again(cut):
    finder, world, _ = cut
    known = Known(finder.roadmap.graph, world.counts.node, world.counts.edge)
    assert _there_and_back(known).graph is _there_and_back(known._replace(node_count=np.zeros_like(known.node_count))).graph
