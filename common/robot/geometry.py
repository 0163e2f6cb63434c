"""What is computed once for an arm's shape: distance grids, sphere covers, the pairs of bodies that can touch, their tables.

A pure function of the bodies, of how the joints join them and how far these turn: neither of where the arm stands nor of its speed or home.
It takes a minute or several, so it is kept in the user's cache.
"""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from common.cache import cache_dir, locked
from common.robot.kernels import BodyGrids, Chain
from common.robot.pair_tables import PairTables, build_pair_tables
from common.robot.pairs import self_collision_pairs
from common.robot.solids import GRID_REACH_M, Body, build_grids

__all__ = ["Geometry", "geometry_of"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
VERSION = 1  # raise when what is computed changes
TABLE = "pair_tables_"  # before the names of its arrays in the file


class Geometry(NamedTuple):
    """Of an arm of B bodies, P pairs of which can touch."""

    grids: BodyGrids
    pairs: I64  # (P, 2)
    pair_usual_m: F64  # (P,) distance that a pair has in half of all poses or more, by the spheres
    pair_tables: PairTables


def geometry_of(bodies: Sequence[Body], chain: Chain, low: F64, high: F64, voxel_m: float) -> Geometry:
    """The geometry of an arm: kept, or computed and kept; of several processes that want it one computes it, the others wait.

    Args:
        bodies: in their joints' frames. chain: the joints; where the arm stands does not count.
        low, high: (J,) joint limits.
        voxel_m: edge of the distance grids' voxels.
    """
    chain = chain._replace(base_rotation=np.eye(3), base_translation=np.zeros(3))
    path = cache_dir() / f"geometry-{_key(bodies, chain, low, high, voxel_m)}.npz"
    kept = _read(path)
    if kept is not None:
        return kept
    with locked(path):
        kept = _read(path)
        if kept is None:
            kept = _compute(tuple(bodies), chain, low, high, voxel_m)
            _write(path, kept)
        return kept


def _key(bodies: Sequence[Body], chain: Chain, low: F64, high: F64, voxel_m: float) -> str:
    digest = hashlib.sha256(f"{VERSION} {voxel_m} {GRID_REACH_M} {[body.joint for body in bodies]}".encode())
    shapes = [array for body in bodies for array in (body.vertices, body.triangles)]
    for array in (*shapes, *chain, low, high):
        digest.update(f"{array.shape}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:16]


def _compute(bodies: tuple[Body, ...], chain: Chain, low: F64, high: F64, voxel_m: float) -> Geometry:
    grids = build_grids(bodies, voxel_m)
    pairs, pair_usual_m = self_collision_pairs(bodies, chain, grids, low, high)
    return Geometry(grids, pairs, pair_usual_m, build_pair_tables(bodies, chain, grids, pairs))


def _write(path: Path, geometry: Geometry) -> None:
    arrays: dict[str, Any] = {name: np.asarray(value) for name, value in geometry.grids._asdict().items()}
    arrays |= {TABLE + name: value for name, value in geometry.pair_tables._asdict().items()}
    with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".tmp", delete=False) as file:
        np.savez(file, pairs=geometry.pairs, pair_usual_m=geometry.pair_usual_m, **arrays)
    Path(file.name).replace(path)  # atomic: whoever reads meanwhile finds none, or all of it


def _read(path: Path) -> Geometry | None:
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        pairs, pair_usual_m = arrays.pop("pairs"), arrays.pop("pair_usual_m")
        tables = PairTables(**{name: arrays.pop(TABLE + name) for name in PairTables._fields})
        arrays["spacing_m"] = float(arrays["spacing_m"])
        return Geometry(BodyGrids(**arrays), pairs, pair_usual_m, tables)
    except (OSError, ValueError, KeyError, TypeError, EOFError, BadZipFile):
        return None  # not there yet, or torn by a crash: made anew
