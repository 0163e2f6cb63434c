"""What an experiment gives: tables, verdicts, raw rows, and the data that its figures are drawn from. Knows nothing of files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

__all__ = ["HOLDS", "IN_PART", "NOT", "NOT_AT_HAND", "UNDECIDED", "Figure", "Outcome", "Row", "Table", "Verdict"]

Row = Mapping[str, Any]  # plain data: one measurement
Holds = Literal["holds", "holds in part", "does not hold", "undecided"]
HOLDS: Holds = "holds"
IN_PART: Holds = "holds in part"
NOT: Holds = "does not hold"
UNDECIDED: Holds = "undecided"
NOT_AT_HAND = "not at hand"  # a figure of the paper that we could not read; never guessed


@dataclass(frozen=True)
class Table:
    """Rows of words and numbers under a title; ``note`` says how to read it."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""


@dataclass(frozen=True)
class Verdict:
    """A claim beside what was measured.

    Attributes:
        claim: what the paper says.
        paper: its number, or ``NOT_AT_HAND``.
        ours: our number, with spread and n, in a line.
        holds: whether the claim holds here.
        word: where ours differs or the claim fails, and why.
        details: further comparisons behind it, a line each.
    """

    claim: str
    paper: str
    ours: str
    holds: Holds
    word: str = ""
    details: Sequence[str] = ()


@dataclass(frozen=True)
class Figure:
    """A picture that was written: ``stem`` without suffix (PNG and SVG are there), and what it shows."""

    stem: str
    caption: str


@dataclass(frozen=True)
class Outcome:
    """The result of one experiment.

    Attributes:
        intro: how it was measured, in a few sentences.
        rows: raw measurements, for CSV and JSON.
        tables, verdicts: for the report.
        facts: other plain data, for JSON.
        data: whatever the drawing needs (arrays); not kept.
    """

    intro: str
    rows: Sequence[Row] = ()
    tables: Sequence[Table] = ()
    verdicts: Sequence[Verdict] = ()
    facts: Mapping[str, Any] = field(default_factory=dict)
    data: Any = None
