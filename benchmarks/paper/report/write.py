"""Writes the report of all kept sections of a folder, and a small copy of it for a repository."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path

from benchmarks.paper.report.document import document
from benchmarks.paper.report.html import html
from benchmarks.paper.report.markdown import markdown
from benchmarks.paper.report.section import read_sections

__all__ = ["keep_copy", "write_report"]


def write_report(out: Path, names: Sequence[str]) -> list[Path]:
    """``report.md`` and ``report.html`` of the parts ``names`` that are kept in ``out``; returns both paths."""
    sections = read_sections(out, names)
    done = {section.name for section in sections}
    whole = document(sections, [name for name in names if name not in done])
    paths = [out / "report.md", out / "report.html"]
    for path, text in zip(paths, (markdown(whole), html(whole)), strict=True):
        path.write_text(text, encoding="utf-8")
    return paths


def keep_copy(out: Path, names: Sequence[str], folder: Path) -> Path:
    """``report.md`` and the PNGs of the report in ``out`` without its raw results; returns the path of the former."""
    sections = read_sections(out, names)
    done = {section.name for section in sections}
    text = markdown(document(sections, [name for name in names if name not in done]), has_data=False)
    (folder / "figures").mkdir(parents=True, exist_ok=True)
    for figure in (figure for section in sections for figure in section.figures):
        shutil.copyfile(out / "figures" / f"{figure.stem}.png", folder / "figures" / f"{figure.stem}.png")
    path = folder / "report.md"
    path.write_text(text, encoding="utf-8")
    return path
