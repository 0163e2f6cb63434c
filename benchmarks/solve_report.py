"""What ``tolman bench solve`` writes, fold by fold, so that a run that was broken off goes on after the last whole fold."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any

import msgspec

from benchmarks.solve_figures import figures
from benchmarks.solving import Record
from common.errors import ConfigError

__all__ = ["Fold", "SolveReport"]


@dataclass(frozen=True)
class Fold:
    """What came of one map: ``facts`` of it (plain data; ``fold`` is its number, or None), and of the problems that it was asked."""

    facts: dict[str, Any]
    records: Sequence[Record]


@dataclass
class SolveReport:
    """The figures of all folds so far.

    Attributes:
        header: plain data; machine, commit, config and what else the figures depend on. Only its date may differ between two runs of
            which the second goes on with the first.
        folds: by number, in the order in which they were asked.
    """

    header: dict[str, Any]
    folds: list[Fold] = field(default_factory=list)

    def kept(self, number: int) -> bool:
        """Whether a fold is there."""
        return any(fold.facts["fold"] == number for fold in self.folds)

    @property
    def sets(self) -> dict[str, dict[str, Any]]:
        """The figures set by set, and of all together."""
        records = [record for fold in self.folds for record in fold.records]
        by_set = sorted(records, key=lambda r: r.set_name)
        sets = {name: figures(list(group)) for name, group in groupby(by_set, key=lambda r: r.set_name)}
        return {**sets, "all": figures(records)}

    def write(self, path: Path) -> None:
        """All of it as JSON; the file is replaced as a whole."""
        folds = [{**fold.facts, "all": figures(fold.records)} for fold in self.folds]
        problems = [{"fold": fold.facts["fold"], **asdict(r)} for fold in self.folds for r in fold.records]
        whole = {**self.header, "maps": folds, "sets": self.sets, "problems": problems}
        partial = path.with_suffix(".part")
        partial.write_text(json.dumps(whole, indent=1) + "\n", encoding="utf-8")
        partial.replace(path)

    def go_on(self, path: Path) -> None:
        """Take the folds of a file that was written with the same header.

        Raises:
            ConfigError: ``bad_report``: there is no such file, it is not one of these, or its header differs; names the first difference.
        """
        try:
            told = json.loads(path.read_text(encoding="utf-8"))
            folds = [
                Fold(
                    {name: value for name, value in facts.items() if name != "all"},
                    [msgspec.convert(r, Record) for r in told["problems"] if r["fold"] == facts["fold"]],
                )
                for facts in told["maps"]
            ]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise ConfigError(f"{path}: no report to go on with: {error}", code="bad_report") from None
        ours = json.loads(json.dumps(self.header))
        for name in ours:
            if name != "date" and told.get(name) != ours[name]:
                raise ConfigError(f"{path}: its {name} is {told.get(name)!r}, now it is {ours[name]!r}", code="bad_report")
        self.folds = folds
