"""A measured part as it is kept: plain data on disk, from which the report is put together again and again."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec

from benchmarks.paper.experiment import Experiment
from benchmarks.paper.outcome import Figure, Outcome, Table, Verdict
from common.errors import ArtefactError

__all__ = ["Section", "read_sections", "write_section"]

DATA = "data"


class Section(msgspec.Struct, frozen=True, kw_only=True):
    """One part: what the report shows of it, its raw rows, and where, when, from what it was measured."""

    name: str
    group: str
    title: str
    intro: str
    scale: str
    only: str
    seconds: float
    load: list[float] = []  # of the machine over the last minute, before and after; 1 is one busy core; empty: unknown
    provenance: dict[str, Any]
    tables: list[Table]
    verdicts: list[Verdict]
    figures: list[Figure]
    facts: dict[str, Any]
    rows: list[dict[str, Any]]

    @staticmethod
    def of(
        experiment: Experiment,
        outcome: Outcome,
        figures: Sequence[Figure],
        *,
        scale: str,
        only: str,
        seconds: float,
        load: list[float],
        provenance: Any,
    ) -> Section:
        """The section of an experiment's outcome."""
        return Section(
            name=f"{experiment.name}.only" if only else experiment.name,  # some rows never stand in for all
            group=experiment.group,
            title=experiment.title,
            intro=outcome.intro,
            scale=scale,
            only=only,
            seconds=round(seconds, 1),
            load=load,
            provenance=provenance,
            tables=list(outcome.tables),
            verdicts=list(outcome.verdicts),
            figures=list(figures),
            facts=dict(outcome.facts),
            rows=[dict(row) for row in outcome.rows],
        )


def write_section(section: Section, out: Path) -> None:
    """``data/<name>.json`` (all) and ``data/<name>.csv`` (raw rows)."""
    folder = out / DATA
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(_finite(msgspec.to_builtins(section)), indent=1, ensure_ascii=False)
    (folder / f"{section.name}.json").write_text(text + "\n", encoding="utf-8")
    columns = list(dict.fromkeys(key for row in section.rows for key in row))
    with (folder / f"{section.name}.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows(section.rows)


def _finite(value: Any) -> Any:
    """JSON knows no infinity and no NaN: they become null."""
    if isinstance(value, float):
        return value if value - value == 0.0 else None
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    return [_finite(item) for item in value] if isinstance(value, list) else value


def read_sections(out: Path, names: Sequence[str]) -> list[Section]:
    """The kept sections of a report, in the order of ``names``; parts that were never run are left out.

    Raises:
        ArtefactError: a file is no section.
    """
    sections = []
    for name in names:
        path = out / DATA / f"{name}.json"
        if not path.exists():
            continue
        try:
            sections.append(msgspec.json.decode(path.read_bytes(), type=Section))
        except msgspec.DecodeError as error:
            raise ArtefactError(f"{path}: is no section of a report: {error}", code="torn_section") from None
    return sections
