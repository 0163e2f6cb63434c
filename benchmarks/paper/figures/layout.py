"""A map of any kind laid onto a square bitmap, neighbours near neighbours."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csgraph
from scipy.sparse.linalg import eigsh

from services.planner.core.roadmap import Roadmap

__all__ = ["lattice_places", "lay_out", "mean_edge_px"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
SHIFT = -1e-3  # the Laplacian is singular: eigenvalues are looked for near a number just below zero


def lattice_places(unit: I32, side: int) -> I32:
    """(N, 2) row and column of the lattice's units (N,) that are neurons."""
    return np.stack([unit // side, unit % side], axis=1).astype(np.int32)


def lay_out(roadmap: Roadmap, side: int) -> I32:
    """(N, 2) row and column for each neuron of a map that has no lattice; at most one neuron a place, N <= side * side.

    The two smoothest non-constant functions on the map's graph (eigenvectors of its normalised Laplacian) are the plane; it is cut in
    halves along the longer side again and again, each half getting as many neurons as it has places. Deterministic.
    """
    place = np.zeros((roadmap.n_neurons, 2), dtype=np.int32)
    plane = _plane(roadmap)
    rest: list[tuple[NDArray[np.int64], tuple[int, int], tuple[int, int]]] = [(np.arange(roadmap.n_neurons), (0, side), (0, side))]
    while rest:
        items, rows, columns = rest.pop()
        n_rows, n_columns = rows[1] - rows[0], columns[1] - columns[0]
        if len(items) == 0 or n_rows * n_columns == 1:
            place[items] = rows[0], columns[0]
            continue
        along = 0 if n_rows >= n_columns else 1
        ordered = items[np.argsort(plane[items, along], kind="stable")]
        low, high = (rows, columns)[along]
        middle = (low + high) // 2
        n_first = round(len(items) * (middle - low) / (high - low))
        for part, span in ((ordered[:n_first], (low, middle)), (ordered[n_first:], (middle, high))):
            rest.append((part, span, columns) if along == 0 else (part, rows, span))
    return place


def _plane(roadmap: Roadmap) -> F64:
    n = roadmap.n_neurons
    a, b = roadmap.edges[:, 0], roadmap.edges[:, 1]
    ones = np.ones(2 * len(a))
    graph = coo_array((ones, (np.concatenate([a, b]), np.concatenate([b, a]))), shape=(n, n)).tocsc()
    laplacian = csgraph.laplacian(graph, normed=True)
    _, vectors = eigsh(laplacian.tocsc(), k=3, sigma=SHIFT, v0=np.linspace(1.0, 2.0, n))
    flat = vectors[:, 1:3]
    return np.asarray(flat * np.sign(flat[np.argmax(np.abs(flat), axis=0), [0, 1]]))  # an eigenvector has no sign of its own


def mean_edge_px(roadmap: Roadmap, place: I32) -> float:
    """Mean distance on the bitmap between neurons that an edge joins, in pixels: how well neighbours lie near neighbours."""
    return float(np.linalg.norm(place[roadmap.edges[:, 0]] - place[roadmap.edges[:, 1]], axis=1).mean())
