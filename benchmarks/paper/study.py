"""What all experiments share: the cell, the trained maps, the scenes, the seed, the sizes, and where progress is told."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from benchmarks.paper.maps import samples_of
from benchmarks.paper.scale import Scale
from benchmarks.questions import Question, questions
from common.cell import CellConfig
from common.config import plain
from services.planner.assemble import Parts, assemble
from services.planner.config import PlannerConfig
from services.planner.core.roadmap import Roadmap
from services.planner.offline.build import Job
from services.planner.offline.motions import Samples
from services.planner.rehearsal import rehearse

__all__ = ["MODELS", "StackOf", "Study", "Tell"]

F64 = NDArray[np.float64]
T = TypeVar("T")
Tell = Callable[[str, float | None], None]  # what is done now, and the share of it that is done

MODELS = ("som", "gamma_som", "gng")


@dataclass(frozen=True)
class StackOf:
    """What the running stack is started with: config file (None: the UR3 cell) and overrides; or a dodge recorded before."""

    config: Path | None = None
    overrides: tuple[str, ...] = ()
    recorded: Path | None = None


def _silent(what: str, share: float | None) -> None:
    del what, share


@dataclass(eq=False)
class Study:
    """One run of the report. Expensive things are made when first asked for and kept."""

    cell: CellConfig
    config: PlannerConfig
    scale: Scale
    seed: int
    tell: Tell = _silent
    only: str = ""  # rows of tables whose name contains this; empty: all
    stack: StackOf = StackOf()
    _kept: dict[str, Any] = field(default_factory=dict)

    def once(self, key: str, make: Callable[[], T]) -> T:
        """What ``make`` gives, made once in this run."""
        if key not in self._kept:
            self._kept[key] = make()
        kept: T = self._kept[key]
        return kept

    def shown(self, items: Iterable[T], what: str, total: int) -> Iterator[T]:
        """The items, with progress told."""
        for k, item in enumerate(items):
            self.tell(what, k / max(1, total))
            yield item
        self.tell(what, 1.0)

    @property
    def job(self) -> Job:
        """Robot, grid and cache of the cell."""
        return self.once("job", lambda: Job.of(self.cell, self.config))

    @property
    def samples(self) -> Samples:
        """The training samples."""
        return self.once("samples", lambda: samples_of(self.job, self.tell))

    @property
    def gng(self) -> Parts:
        """The planner as shipped: growing neural gas."""

        def make() -> Parts:
            parts = assemble(self.cell, self.config, self.tell)
            self.tell("compiling", None)
            rehearse(parts, time.monotonic_ns)
            return parts

        return self.once("gng", make)

    def parts(self, model: str) -> Parts:
        """The whole planner on the map of a model, one of :data:`MODELS`."""
        if model == "gng":
            return self.gng
        config = msgspec.structs.replace(self.config, model=model, **self._lattices())
        return self.once(f"parts {model}", lambda: assemble(self.cell, config, self.tell))

    def lattice_unit(self, model: str) -> NDArray[np.int32] | None:
        """(N,) which unit of its lattice each neuron is, row * columns + column; None for a gas."""
        return self.parts(model).built.lattice_unit

    def _lattices(self) -> dict[str, Any]:
        side = self.scale.lattice_side
        som = msgspec.structs.replace(self.config.som, rows=side, columns=side)
        gamma = msgspec.structs.replace(self.config.gamma_som, rows=side, columns=side, epochs=self.scale.gamma_epochs)
        return {"som": som, "gamma_som": gamma}

    def on(self, roadmap: Roadmap, config: PlannerConfig | None = None) -> Parts:
        """The whole planner on another map of the same cell."""
        return replace(self.gng, roadmap=roadmap, config=config or self.config)

    def sized(self, n_neurons: int) -> Parts:
        """The whole planner on a gas of another size."""
        if n_neurons == self.config.map.n_neurons:
            return self.gng
        sized = msgspec.structs.replace(self.config.map, n_neurons=n_neurons)
        config = msgspec.structs.replace(self.config, map=sized)
        return self.once(f"gng {n_neurons}", lambda: assemble(self.cell, config, self.tell))

    def scenes(self, n: int, name: str = "task") -> list[Question]:
        """The first ``n`` questions of a set, the same for all models."""
        kept: list[Question] = self.once(f"questions {name}", list)
        if len(kept) < n:
            kept[:] = self.shown(questions(self.gng, name, n, self.seed), "drawing scenes", n)
        return kept[:n]

    @property
    def plain_config(self) -> dict[str, Any]:
        """Everything a figure depends on, as plain data."""
        return {"planner": plain(self.config), "cell": plain(self.cell), "scale": plain(self.scale)}
