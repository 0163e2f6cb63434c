"""``tolman map``: what the map has learned since it was built (log), and undoing it (revert N)."""

from __future__ import annotations

import argparse
from datetime import UTC, datetime
from typing import Any

from clients.cli.options import add_cell_arguments, print_json
from common import cell
from common.errors import ArtefactError, ConfigError
from services.planner.config import PlannerConfig
from services.planner.offline.build import Job, load
from services.planner.offline.journal import Entry, Journal, journal_path

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Log, or revert."""
    parser.epilog = (
        "Works on the journal in the cache, without a stack. A planner that runs keeps what it has after a revert, learns no more, and "
        "takes the journal up at its next start. A journal that is torn or of another map is refused by name; revert 0 does away with it."
    )
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    log = actions.add_parser("log", help="list what was learned: number, when, source, neurons, edges, label")
    log.add_argument("--json", action="store_true", help="one JSON line an entry")
    revert = actions.add_parser("revert", help="undo all after entry NUMBER; 0 undoes everything")
    revert.add_argument("number", type=int, metavar="NUMBER", help="the last entry that stays")
    for action in (log, revert):
        add_cell_arguments(action)


def run(args: argparse.Namespace) -> int:
    """0: told, or undone."""
    shared, config = cell.load(args.config, "planner", PlannerConfig, args.set)
    built = load(Job.of(shared, config))
    path = journal_path(built.path, built.sha256)
    try:
        journal = Journal.read(path, built.sha256, built.learned.n_neurons, built.learned.q_rad.shape[1])
    except ArtefactError:
        if args.action == "revert" and args.number == 0:
            path.unlink()
            print(f"{path} could not be used and is gone")
            return 0
        raise
    return _log(journal, as_json=args.json) if args.action == "log" else _revert(journal, args.number)


def _log(journal: Journal, *, as_json: bool) -> int:
    for entry in journal.entries:
        print_json(_facts(entry)) if as_json else print(_line(entry))
    if not as_json:
        print(f"{journal.path}: {len(journal.entries)} entries, {journal.n_added_neurons} neurons on top of {journal.n_neurons}")
    return 0


def _revert(journal: Journal, number: int) -> int:
    n = len(journal.entries)
    if not 0 <= number <= n:
        raise ConfigError(f"NUMBER: {number} is outside 0..{n}, the entries that there are")
    journal.reverted(number)
    print(f"{n - number} of {n} entries undone; a running planner takes it up at its next start")
    return 0


def _facts(entry: Entry) -> dict[str, Any]:
    return {
        "number": entry.number,
        "learned_utc_ns": entry.learned_utc_ns,
        "label": entry.label,
        "source": entry.source,
        "added_neurons": len(entry.addition.neurons_rad),
        "added_edges": len(entry.addition.edges),
    }


def _line(entry: Entry) -> str:
    facts = _facts(entry)
    at = datetime.fromtimestamp(entry.learned_utc_ns / 1e9, UTC).astimezone()
    added = f"{facts['added_neurons']:>5} neurons {facts['added_edges']:>6} edges"
    return f"{entry.number:>4}  {at:%Y-%m-%d %H:%M:%S}  {entry.source:<9} {added}  {entry.label}".rstrip()
