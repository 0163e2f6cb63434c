"""The report as one HTML page beside its figures and data."""

from __future__ import annotations

from importlib import resources

from jinja2 import Environment, StrictUndefined
from markdown_it import MarkdownIt
from markupsafe import Markup

from benchmarks.paper.report.document import Document
from benchmarks.paper.report.markdown import QUICK_WORD, redo

__all__ = ["html"]

BADGES = {"holds": "yes", "holds in part": "part", "does not hold": "no", "undecided": "open"}
NUMBER = set("0123456789–")


def html(document: Document) -> str:
    """The whole page, styled, without scripts and without anything from elsewhere."""
    reader = MarkdownIt("commonmark", {"html": False})
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters["inline"] = lambda text: Markup(reader.renderInline(text))
    environment.filters["blocks"] = lambda text: Markup(reader.render(text))
    environment.filters["badge"] = lambda holds: BADGES[holds]
    environment.filters["is_number"] = lambda text: text.lstrip("*")[:1] in NUMBER
    template = environment.from_string(resources.files(__package__).joinpath("page.html.j2").read_text(encoding="utf-8"))
    is_quick = any(section.scale != "full" for _, part in document.groups for section in part)
    return template.render(d=document, redo=redo, quick=QUICK_WORD.removeprefix("> ") if is_quick else "", badges=BADGES)
