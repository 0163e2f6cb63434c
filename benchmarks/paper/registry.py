"""Every part of the report by name. A part's modules are imported only when it is run."""

from __future__ import annotations

import difflib
import importlib
from collections.abc import Sequence
from dataclasses import dataclass

from benchmarks.paper.experiment import Experiment, Group
from common.errors import RequestError

__all__ = ["GROUPS", "NAMES", "experiment", "resolve"]

HERE = "benchmarks.paper"


@dataclass(frozen=True)
class Entry:
    """Where a part lives: ``module`` has ``measure``; ``<module>_drawing``, if ``drawn``, has ``draw``."""

    group: Group
    title: str
    module: str
    drawn: bool = True


PARTS: dict[str, Entry] = {
    "table1": Entry("tables", "Table I: models and algorithms", "table1", False),
    "table2": Entry("tables", "Table II: against sample-based planners", "table2", False),
    "bitmaps": Entry("figures", "Cognitive maps and tool paths", "figures.bitmaps"),
    "samplers": Entry("figures", "Runs of the sampling planners", "figures.samplers"),
    "dodge": Entry("figures", "A dodge in the running stack", "figures.dodge"),
    "two-link": Entry("figures", "The lookup table of a two-link arm", "figures.two_link"),
    "gng-shorter": Entry("claims", "GNG paths are shorter than γ-SOM paths", "claims.gng_shorter"),
    "dijkstra-shorter": Entry("claims", "Dijkstra is shorter than the wavefront", "claims.dijkstra_shorter"),
    "big-obstacles": Entry("claims", "γ-SOM fails more often at big obstacles", "claims.big_obstacles"),
    "solved-share": Entry("claims", "What each map solves", "claims.solved_share"),
    "smoothing-cost": Entry("claims", "Smoothing is the costliest step", "claims.smoothing_cost"),
    "reproducible": Entry("claims", "Paths are reproducible", "claims.reproducible"),
    "resolution": Entry("claims", "Path resolution against network size", "claims.resolution"),
    "table-memory": Entry("claims", "Memory of the lookup table, and a bit-encoded one", "claims.table_memory"),
    "clutter": Entry("claims", "Clutter and narrow passages", "claims.clutter"),
    "constraints": Entry("claims", "Constraints by data", "claims.constraints"),
    "extension": Entry("claims", "A gas is extended instead of trained anew", "claims.extension"),
}
NAMES = tuple(PARTS)
GROUPS: dict[str, tuple[str, ...]] = {
    "all": NAMES,
    **{group: tuple(name for name, entry in PARTS.items() if entry.group == group) for group in ("tables", "figures", "claims")},
}


def resolve(words: Sequence[str]) -> list[str]:
    """Names of parts, in the order of the report, for names of parts and groups; no word means all.

    Raises:
        RequestError: a name that is neither; lists the known ones.
    """
    wanted: set[str] = set()
    for word in words or ["all"]:
        if word in GROUPS:
            wanted |= set(GROUPS[word])
        elif word in PARTS:
            wanted.add(word)
        else:
            near = difflib.get_close_matches(word, [*GROUPS, *NAMES], n=1)
            hint = f"; did you mean {near[0]}?" if near else ""
            known = f"groups: {', '.join(GROUPS)}; parts: {', '.join(NAMES)}"
            raise RequestError(f"{word!r} is no part of the report{hint} ({known})", code="unknown_part")
    return [name for name in NAMES if name in wanted]


def experiment(name: str) -> Experiment:
    """The part called ``name``, ready to be run."""
    entry = PARTS[name]
    measure = importlib.import_module(f"{HERE}.{entry.module}").measure
    draw = importlib.import_module(f"{HERE}.{entry.module}_drawing").draw if entry.drawn else None
    return Experiment(name, entry.group, entry.title, measure, draw)
