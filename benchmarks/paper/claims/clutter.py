"""Clutter and narrow passages: share solved and time, on the map alone and by RRTConnect."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from benchmarks.paper import words
from benchmarks.paper.ask import Variant, answer
from benchmarks.paper.claims.clutter_scenes import clutter, gap_question
from benchmarks.paper.outcome import HOLDS, IN_PART, NOT, NOT_AT_HAND, UNDECIDED, Holds, Outcome, Table, Verdict
from benchmarks.paper.stats import median, percentile, share
from benchmarks.paper.study import Study
from benchmarks.peers.peer import Setting
from benchmarks.peers.registry import make_peer
from benchmarks.questions import Question

__all__ = ["PEER", "WAYS", "Try", "measure"]

PEER = "ompl_rrt_connect"
WAYS = ("gng-paper", "gng-checked", PEER)
INTRO = (
    "Clutter: 1 to 8 boxes of 6 to 20 cm about the way, {n} scenes each; start and goal of the set “task”. Narrow passage: the tool "
    "reaches 9 cm deep between two walls that stand 8 to 30 cm apart, {tries} starts each; the gripper is 6 cm wide and 2 cm are kept on "
    "each side. The map alone answers (GNG, Dijkstra, smoothed, by both rules; no fallback), and OMPL's RRTConnect with simplification, "
    "{limit:g} s at most. A scene that nobody solves may have no solution. An answer by the paper's rules counts even if it touches "
    "something; Table I says how often that is."
)


@dataclass(frozen=True)
class Try:
    """One way of planning in one scene: ``kind`` is boxes or gap, ``level`` their number or its width in metres."""

    kind: str
    level: float
    scene: int
    way: str
    solved: bool
    ms: float


def measure(study: Study) -> Outcome:
    """Both series."""
    scale = study.scale
    tries: list[Try] = []
    for n_boxes in scale.clutter_boxes:
        scenes = list(clutter(study, n_boxes, scale.n_clutter_scenes))
        tries += _ask(study, "boxes", float(n_boxes), scenes)
    impossible = []
    for gap_m in scale.gaps_m:
        asked = [gap_question(study, gap_m, scene) for scene in study.scenes(scale.n_gap_tries)]
        possible = [question for question in asked if question is not None]
        if not possible:
            impossible.append(gap_m)
        tries += _ask(study, "gap", gap_m, possible)
    tables = [
        _table(tries, "boxes", "Clutter", "boxes", [f"{n}" for n in scale.clutter_boxes], [float(n) for n in scale.clutter_boxes]),
        _table(tries, "gap", "Narrow passage", "gap, cm", [f"{100 * g:.0f}" for g in scale.gaps_m], scale.gaps_m),
    ]
    note = (
        f"No pose of the tool in a gap of {', '.join(f'{100 * g:.0f}' for g in impossible)} cm keeps the safety distance: nobody may go "
        "there."
        if impossible
        else ""
    )
    return Outcome(
        INTRO.format(n=scale.n_clutter_scenes, tries=scale.n_gap_tries, limit=scale.peer_limit_s),
        rows=[{"row": t.way, "kind": t.kind, "level": t.level, "question": t.scene, "solved": t.solved, "ms": t.ms} for t in tries],
        tables=tables,
        verdicts=[_verdict(tries, "boxes", "clutter", ""), _verdict(tries, "gap", "narrow passages", note)],
        data=tries,
    )


def _ask(study: Study, kind: str, level: float, scenes: Sequence[Question]) -> list[Try]:
    parts = study.gng
    planner = study.once("planner gng", parts.motion_planner)
    peer = study.once(f"peer {PEER}", lambda: make_peer(PEER, Setting.of_parts(parts)))
    tries = []
    for question in study.shown(scenes, f"{kind} {level:g}", len(scenes)):
        for way, rules in (("gng-paper", "paper"), ("gng-checked", "checked")):
            got = answer(parts, planner, question, Variant("gng", "dijkstra", True, rules))  # type: ignore[arg-type]  # one of the two literals
            tries.append(Try(kind, level, question.index, way, got.solved, got.ms["total"]))
        theirs = peer.solve(question, study.scale.peer_limit_s, study.seed + question.index, True)
        tries.append(Try(kind, level, question.index, PEER, theirs.path_rad is not None, 1e3 * theirs.seconds["total"]))
    return tries


def way_name(way: str) -> str:
    """How the report calls a way of planning."""
    return words.PEER[way] if way == PEER else f"GNG, {words.RULES_WORD[way.partition('-')[2]]} rules"


def _table(tries: Sequence[Try], kind: str, title: str, head: str, labels: Sequence[str], levels: Sequence[float]) -> Table:
    rows = []
    for label, level in zip(labels, levels, strict=True):
        row = [label]
        for way in WAYS:
            mine = [t for t in tries if (t.kind, t.level, t.way) == (kind, level, way)]
            times = [t.ms for t in mine if t.solved]
            row += [share(sum(t.solved for t in mine), len(mine)), f"{median(times, 1)} / {percentile(times, 95, 1)}"]
        rows.append(row)
    columns = [head, *(text for way in WAYS for text in (f"{way_name(way)}: solved", "ms, median / p95"))]
    return Table(title, columns, rows, "Times of what was solved.")


def _verdict(tries: Sequence[Try], kind: str, what: str, note: str) -> Verdict:
    mine = [t for t in tries if t.kind == kind]
    solved = {way: sum(t.solved for t in mine if t.way == way) for way in WAYS}
    n = sum(t.way == PEER for t in mine)
    times = {way: [t.ms for t in mine if t.way == way and t.solved] for way in WAYS}
    said = "; ".join(f"{way_name(way)} {share(solved[way], n)}, median {median(times[way], 1)} ms" for way in WAYS)
    faster = bool(times["gng-checked"]) and (not times[PEER] or float(median(times["gng-checked"], 6)) < float(median(times[PEER], 6)))
    as_many = solved["gng-checked"] >= solved[PEER]
    holds: Holds = UNDECIDED if n == 0 else HOLDS if faster and as_many else IN_PART if faster or as_many else NOT
    word = "Ours is faster but solves fewer: what no neuron covers, the map cannot find."
    parts = [word if faster and not as_many else "", note]
    return Verdict(f"The map stands up to RRTConnect in {what}", NOT_AT_HAND, said, holds, " ".join(part for part in parts if part))
