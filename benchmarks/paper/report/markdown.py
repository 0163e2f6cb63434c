"""The report as Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from benchmarks.paper.outcome import Table, Verdict
from benchmarks.paper.report.document import Document
from benchmarks.paper.report.section import Section

__all__ = ["QUICK_WORD", "markdown", "redo", "section_markdown"]

QUICK_WORD = (
    "> **A quick run on small maps.** It shows that every part works; its numbers mean nothing. `tolman paper` without `--quick` measures."
)


def markdown(document: Document, *, has_data: bool = True) -> str:
    """The whole report; figures and, if it ``has_data``, raw results are linked relative to it."""
    lines = [f"# {document.title}", "", document.lead, ""]
    if any(section.scale != "full" for _, part in document.groups for section in part):
        lines += [QUICK_WORD, ""]
    lines += ["| | |", "|---|---|", *(f"| {_cell(name)} | {_cell(value)} |" for name, value in document.facts), "", document.differs, ""]
    if document.glance.rows:
        lines += ["## Claims at a glance", "", f"{document.summary}.", "", *_table(document.glance)]
    if document.missing:
        lines += [f"Parts not in this report: {', '.join(f'`{name}`' for name in document.missing)}.", ""]
    for title, sections in document.groups:
        lines += [f"## {title}", ""]
        for section in sections:
            lines += _section(section, has_data)
    lines += [f"## {document.known.title}", "", *_table(document.known)]
    return "\n".join(lines).rstrip() + "\n"


def section_markdown(section: Section) -> str:
    """One section by itself."""
    return "\n".join(_section(section, has_data=True)).rstrip() + "\n"


def _section(section: Section, has_data: bool) -> Iterator[str]:
    yield from (f"### {section.title}", "", section.intro, "")
    for verdict in section.verdicts:
        yield from _verdict(verdict)
    for figure in section.figures:
        yield from (f"![{_plain(figure.caption)}](figures/{figure.stem}.png)", "", f"*{figure.caption}*", "")
    for table in section.tables:
        yield from (f"**{table.title}**", "")
        yield from _table(table)
    yield from (redo(section, has_data=has_data), "")


def redo(section: Section, *, has_data: bool = True) -> str:
    """How to measure a section again, and where its raw rows are."""
    words = [f"tolman paper {section.name.removesuffix('.only')}", "--quick" if section.scale == "quick" else ""]
    words += [f"--only {section.only}" if section.only else "", f"--seed {section.provenance['seed']}"]
    load = f", load of the machine {section.load[0]:.1f} before and {section.load[1]:.1f} after" if len(section.load) == 2 else ""
    again = f"Again: `{' '.join(word for word in words if word)}`; {section.seconds:.0f} s{load}. "
    if not has_data:
        return f"{again}Measured at commit {section.provenance['commit']}; raw results come with a run."
    return (
        f"{again}Raw: [CSV](data/{section.name}.csv), [JSON](data/{section.name}.json) with seed, config, machine and commit "
        f"{section.provenance['commit']}."
    )


def _verdict(verdict: Verdict) -> Iterator[str]:
    yield from (f"> **{verdict.claim}** — **{verdict.holds}**", ">", f"> Paper: {verdict.paper}. Ours: {verdict.ours}.")
    if verdict.details:
        yield from (">", *(f"> - {line}" for line in verdict.details))
    if verdict.word:
        yield from (">", f"> {verdict.word}")
    yield ""


def _table(table: Table) -> Iterator[str]:
    yield _row(table.columns)
    yield "|" + "---|" * len(table.columns)
    for row in table.rows:
        yield _row(row)
    yield ""
    if table.note:
        yield from (table.note, "")


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(_cell(cell) for cell in cells) + " |"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def _plain(text: str) -> str:
    return text.replace("*", "").replace("[", "(").replace("]", ")")
