"""The report as data: head, verdicts at a glance, sections. Markdown and HTML are written from this alone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from benchmarks.paper.known import KNOWN, PAPER
from benchmarks.paper.outcome import HOLDS, IN_PART, NOT, UNDECIDED, Table
from benchmarks.paper.report.section import Section

__all__ = ["GROUP_TITLES", "Document", "document"]

HOLDS_ORDER = (HOLDS, IN_PART, NOT, UNDECIDED)
GROUP_TITLES = {"tables": "Tables", "figures": "Figures", "claims": "Claims"}
LEAD = (
    "Each table, figure and claim of the paper beside ours: the paper's number, our number, its spread and n, and a word where ours "
    "differs or the claim does not hold. Everything here was measured by `tolman paper`; nothing is typed in. Where a number of the "
    "paper was not at hand, it says so."
)
DIFFERS = (
    "**What differs from the paper, everywhere.** Our arm is a UR3 in simulation (the paper: a real UR3e); training motions come from a "
    "sampling planner between two bins, half of them among boxes (the paper: motions of its own task); the machine is the one named here "
    "(the paper's is not at hand); code is numba on one thread. Start and goal are inverse-kinematics poses that no training motion "
    "holds. Times are wall-clock times; each part says how busy the machine was."
)


@dataclass(frozen=True)
class Document:
    """Everything that both forms of the report show."""

    title: str
    lead: str
    differs: str
    facts: Sequence[tuple[str, str]]
    summary: str
    glance: Table
    known: Table
    groups: Sequence[tuple[str, Sequence[Section]]]
    missing: Sequence[str]


def document(sections: Sequence[Section], missing: Sequence[str]) -> Document:
    """The report of some sections; ``missing``: names of parts that were not run."""
    groups = [(title, [s for s in sections if s.group == group]) for group, title in GROUP_TITLES.items()]
    verdicts = [(section, verdict) for section in sections for verdict in section.verdicts]
    counts = Counter(verdict.holds for _, verdict in verdicts)
    glance = Table(
        "Claims at a glance",
        ("claim", "verdict", "ours", "part"),
        [(verdict.claim, verdict.holds, verdict.ours, section.name) for section, verdict in verdicts],
    )
    known = Table(
        "Figures of the paper that are at hand", ("what", "value", "read in"), [(k.what, k.value, k.source) for k in KNOWN.values()]
    )
    return Document(
        title="The paper's experiments, repeated",
        lead=f"{LEAD}\n\n*{PAPER}*",
        differs=DIFFERS,
        facts=_facts(sections),
        summary=", ".join(f"{holds}: {counts[holds]}" for holds in HOLDS_ORDER if counts[holds]),
        glance=glance,
        known=known,
        groups=[(title, part) for title, part in groups if part],
        missing=missing,
    )


def _facts(sections: Sequence[Section]) -> list[tuple[str, str]]:
    def every(values: Sequence[str]) -> str:
        return ", ".join(dict.fromkeys(values))

    machines = [s.provenance["machine"] for s in sections]
    described = [f"{m['processor']}, {m['cores']} cores, {m['memory_gib']} GiB, {m['system']}, Python {m['python']}" for m in machines]
    return [
        ("machine", every(described)),
        ("commit", every([s.provenance["commit"] for s in sections])),
        ("measured", every(sorted({s.provenance["date"][:10] for s in sections}))),
        ("seed", every([str(s.provenance["seed"]) for s in sections])),
        ("scale", every([s.scale for s in sections])),
        ("seconds in all", f"{sum(s.seconds for s in sections):.0f}, without the training of maps that the cache had"),
    ]
