"""The referee's word on paths of the report, each looked at once however many rows it stands in."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np

from benchmarks import judging
from benchmarks.judging import Case
from benchmarks.paper.study import Study

__all__ = ["Case", "collisions"]


def collisions(study: Study, cases: Sequence[Case]) -> list[bool]:
    """Whether each path truly collides: with a box's true shape, the static layer or the arm itself."""
    known: dict[bytes, bool] = study.once("judged", dict)
    keys = [_key(case) for case in cases]
    new = {key: case for key, case in zip(keys, cases, strict=True) if key not in known}
    verdicts = judging.collisions(study.cell, list(new.values()), lambda found, n: study.shown(found, "referee", n))
    known.update(zip(new, verdicts, strict=True))
    return [known[key] for key in keys]


def _key(case: Case) -> bytes:
    """Equal for equal paths among equal boxes."""
    digest = hashlib.sha256(np.ascontiguousarray(case.path_rad).tobytes())
    digest.update(np.ascontiguousarray(case.boxes_m).tobytes())
    return digest.digest()
