"""Writes the report of all kept sections of a folder, and a small copy of it for a repository."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PIL import Image

from benchmarks.paper.report.document import document
from benchmarks.paper.report.html import html
from benchmarks.paper.report.markdown import markdown
from benchmarks.paper.report.section import read_sections

__all__ = ["keep_copy", "write_report"]

KEPT_WIDTH_PX, KEPT_COLOURS = 1100, 96  # our choice: sharp on a page, small in a repository


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
        _copy_small(out / "figures" / f"{figure.stem}.png", folder / "figures" / f"{figure.stem}.png")
    path = folder / "report.md"
    path.write_text(text, encoding="utf-8")
    return path


def _copy_small(source: Path, target: Path) -> None:
    """A picture with few colours and no wider than a page: a third of the bytes."""
    picture = Image.open(source).convert("RGB")
    if picture.width > KEPT_WIDTH_PX:
        picture = picture.resize((KEPT_WIDTH_PX, round(picture.height * KEPT_WIDTH_PX / picture.width)), Image.Resampling.LANCZOS)
    picture.quantize(KEPT_COLOURS).save(target, optimize=True)
