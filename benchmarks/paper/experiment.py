"""What the registry holds: an experiment has a name, a measurement and, mostly, drawings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

from benchmarks.paper.outcome import Figure, Outcome
from benchmarks.paper.study import Study

__all__ = ["Draw", "Experiment", "Group"]

Group = Literal["tables", "figures", "claims"]


class Draw(Protocol):
    """Draws an outcome's data into files of a folder and says which."""

    def __call__(self, outcome: Outcome, folder: Path) -> Sequence[Figure]:
        """Write ``<folder>/<stem>.png`` and ``.svg`` for each figure."""
        ...


@dataclass(frozen=True)
class Experiment:
    """One part of the report."""

    name: str
    group: Group
    title: str
    measure: Callable[[Study], Outcome]
    draw: Draw | None = None
