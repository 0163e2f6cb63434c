"""Writes the report of all kept sections of a folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from benchmarks.paper.report.document import document
from benchmarks.paper.report.html import html
from benchmarks.paper.report.markdown import markdown
from benchmarks.paper.report.section import read_sections

__all__ = ["write_report"]


def write_report(out: Path, names: Sequence[str]) -> list[Path]:
    """``report.md`` and ``report.html`` of the parts ``names`` that are kept in ``out``; returns both paths."""
    sections = read_sections(out, names)
    done = {section.name for section in sections}
    whole = document(sections, [name for name in names if name not in done])
    paths = [out / "report.md", out / "report.html"]
    for path, text in zip(paths, (markdown(whole), html(whole)), strict=True):
        path.write_text(text, encoding="utf-8")
    return paths
