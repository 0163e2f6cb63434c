"""What the planner remembers of earlier starts: the built map, and what it has learned since, from the journal beside it."""

from __future__ import annotations

from dataclasses import dataclass

from common.errors import ArtefactError
from services.planner.assemble import Parts
from services.planner.core.growth import grown
from services.planner.offline.journal import Journal, journal_path

__all__ = ["Memory", "journal_of", "recall"]


@dataclass(frozen=True, eq=False)
class Memory:
    """Parts whose roadmap has what was learned, the journal that says so (None: not kept), and what is wrong with it (empty: nothing)."""

    parts: Parts
    journal: Journal | None
    complaint: str = ""


def journal_of(parts: Parts) -> Journal:
    """The journal of the built map of ``parts``.

    Raises:
        ArtefactError: it cannot be used.
    """
    built = parts.built
    path = journal_path(built.path, built.sha256)
    return Journal.read(path, built.sha256, built.learned.n_neurons, parts.robot.n_joints)


def recall(parts: Parts) -> Memory:
    """Replay the journal on the built map; the map as it was built where it cannot be used or is not wanted (``learning.keep``).

    A SOM or gamma-SOM learns nothing while it runs (:mod:`services.planner.learner`), so it has no journal.
    """
    if not parts.config.learning.keep or parts.roadmap.model != "gng":
        return Memory(parts, None)
    try:
        journal = journal_of(parts)
    except ArtefactError as error:
        return Memory(parts, None, f"{error.code}: {error.message}")
    return Memory(parts.on(grown(parts.roadmap, journal.addition, parts.ground)), journal)
