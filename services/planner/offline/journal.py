"""What a map has learned since it was built: a journal beside the artefact, one file for each map.

Text, a JSON object a line. The first line says what it is of; each further one is an entry with what joined the map, as numbers, so that
replaying it needs no check and depends on no config. Every line holds the SHA-256 of itself and all before it. The file is only ever
replaced as a whole, under a lock, by one who knows its end: readers see it before or after, and two planners cannot mix their entries.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from common.cache import locked
from common.errors import ArtefactError
from services.planner.core.growth import Addition

__all__ = ["FORMAT", "VERSION", "Entry", "Journal", "journal_path"]

FORMAT = "tolman-learned"
VERSION = 1  # raise when the meaning of a line changes


@dataclass(frozen=True, eq=False)
class Entry:
    """One lesson: ``number`` from 1, when it was learned (UTC), what it was called, who asked for it, and what joined the map."""

    number: int
    learned_utc_ns: int
    label: str
    source: str
    addition: Addition


def journal_path(map_path: Path, map_sha256: str) -> Path:
    """Where the journal of a map is kept."""
    return map_path.parent / f"learned-{map_sha256[:16]}.jsonl"


@dataclass(frozen=True, eq=False)
class Journal:
    """A journal as read.

    Attributes:
        path: of the file; it need not be there.
        map_sha256: of the artefact that the entries add to.
        n_neurons, n_joints: of that map.
        entries: in order.
        head: SHA-256 of the last line, empty without a file.
    """

    path: Path
    map_sha256: str
    n_neurons: int
    n_joints: int
    entries: tuple[Entry, ...] = ()
    head: str = ""

    @staticmethod
    def read(path: Path, map_sha256: str, n_neurons: int, n_joints: int) -> Journal:
        """The journal of a map; empty if there is no file.

        Raises:
            ArtefactError: with code ``torn_journal``, ``journal_version`` or ``foreign_journal``; names file, line and what is wrong.
        """
        empty = Journal(path, map_sha256, n_neurons, n_joints)
        try:
            text = path.read_bytes()
        except FileNotFoundError:
            return empty
        except OSError as error:
            raise ArtefactError(f"{path}: cannot be read: {error.strerror}", code="torn_journal", facts={"path": str(path)}) from None
        return _parse(empty, text)

    @property
    def n_added_neurons(self) -> int:
        """Neurons of all entries."""
        return sum(len(entry.addition.neurons_rad) for entry in self.entries)

    @property
    def addition(self) -> Addition:
        """All entries as one."""
        additions = [entry.addition for entry in self.entries]
        neurons = [np.empty((0, self.n_joints)), *(a.neurons_rad for a in additions)]
        edges = [np.empty((0, 2), dtype=np.int32), *(a.edges for a in additions)]
        return Addition(np.vstack(neurons), np.vstack(edges))

    def with_entry(self, learned_utc_ns: int, label: str, source: str, addition: Addition) -> Journal:
        """The journal with one entry more, as written.

        Raises:
            ArtefactError: the file is not what this journal was read from (``journal_changed``), or torn.
            OSError: the disk says no.
        """
        entry = Entry(len(self.entries) + 1, learned_utc_ns, label, source, addition)
        return self._replaced((*self.entries, entry))

    def reverted(self, number: int) -> Journal:
        """The journal with entries 1 to ``number`` only, as written; the errors of :meth:`with_entry`."""
        return self._replaced(self.entries[:number])

    def _replaced(self, entries: Sequence[Entry]) -> Journal:
        lines, head = _lines(self, entries)
        with locked(self.path):
            now = Journal.read(self.path, self.map_sha256, self.n_neurons, self.n_joints)
            if now.head != self.head:
                raise ArtefactError(
                    f"{self.path}: has changed since it was read (another planner, or tolman map revert); start again to take it up",
                    code="journal_changed",
                    facts={"path": str(self.path)},
                )
            _write(self.path, lines)
        return Journal(self.path, self.map_sha256, self.n_neurons, self.n_joints, tuple(entries), head)


def _lines(journal: Journal, entries: Sequence[Entry]) -> tuple[list[bytes], str]:
    header = {
        "format": FORMAT,
        "version": VERSION,
        "map_sha256": journal.map_sha256,
        "n_neurons": journal.n_neurons,
        "n_joints": journal.n_joints,
    }
    rows: list[dict[str, Any]] = [header]
    for entry in entries:
        row = {"number": entry.number, "learned_utc_ns": entry.learned_utc_ns, "label": entry.label, "source": entry.source}
        rows.append({**row, "neurons_rad": entry.addition.neurons_rad.tolist(), "edges": entry.addition.edges.tolist()})
    lines, head = [], ""
    for row in rows:
        head = _digest(head, row)
        lines.append(json.dumps({**row, "sha256": head}, separators=(",", ":")).encode() + b"\n")
    return lines, head


def _digest(before: str, row: dict[str, Any]) -> str:
    return hashlib.sha256(before.encode() + json.dumps(row, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def _parse(empty: Journal, text: bytes) -> Journal:
    rows, head = [], ""
    for number, line in enumerate(text.splitlines(keepends=True), 1):
        try:
            row = json.loads(line)
            told = row.pop("sha256")
        except (ValueError, KeyError, AttributeError, TypeError):
            raise _torn(empty.path, number, "it is not a line of a journal") from None
        head = _digest(head, row)
        if told != head or not line.endswith(b"\n"):
            raise _torn(empty.path, number, "it does not have the SHA-256 that it ends with")
        rows.append(row)
    if not rows:
        raise _torn(empty.path, 1, "the file is empty")
    _check_header(empty, rows[0])
    entries: list[Entry] = []
    n = empty.n_neurons
    for number, row in enumerate(rows[1:], 1):
        try:
            entries.append(_entry(row, number, n, empty.n_joints))
        except (KeyError, ValueError, TypeError, OverflowError) as error:
            raise _torn(empty.path, number + 1, f"entry {number}: {error}") from None
        n += len(entries[-1].addition.neurons_rad)
    return Journal(empty.path, empty.map_sha256, empty.n_neurons, empty.n_joints, tuple(entries), head)


def _check_header(empty: Journal, header: dict[str, Any]) -> None:
    path = str(empty.path)
    if header.get("format") != FORMAT or header.get("version") != VERSION:
        facts = {"path": path, "found": str(header.get("version")), "expected": str(VERSION)}
        text = f"{path}: format {header.get('format')!r} version {header.get('version')!r}, this tolman reads {FORMAT!r} {VERSION}"
        raise ArtefactError(text, code="journal_version", facts=facts)
    for what in ("map_sha256", "n_neurons", "n_joints"):
        if header.get(what) != getattr(empty, what):
            facts = {"path": path, "what": what, "found": str(header.get(what)), "expected": str(getattr(empty, what))}
            text = f"{path}: of another map: {what} {header.get(what)!r}, expected {getattr(empty, what)!r}"
            raise ArtefactError(text, code="foreign_journal", facts=facts)


def _entry(row: dict[str, Any], number: int, n_before: int, n_joints: int) -> Entry:
    neurons = np.array(row["neurons_rad"], dtype=np.float64).reshape(-1, n_joints)
    edges = np.array(row["edges"], dtype=np.int32).reshape(-1, 2)
    if row["number"] != number:
        raise ValueError(f"its number is {row['number']!r}")
    if not np.all(np.isfinite(neurons)):
        raise ValueError("a neuron is not finite")
    n = n_before + len(neurons)
    if len(edges) and (edges.min() < 0 or edges.max() >= n or np.any(edges[:, 0] >= edges[:, 1])):
        raise ValueError(f"an edge does not join two of the neurons 0..{n - 1}")
    return Entry(number, int(row["learned_utc_ns"]), str(row["label"]), str(row["source"]), Addition(neurons, edges))


def _torn(path: Path, line: int, why: str) -> ArtefactError:
    text = f"{path}, line {line}: torn or no journal: {why}; without the file the map is as it was built"
    return ArtefactError(text, code="torn_journal", facts={"path": str(path), "line": line, "why": why})


def _write(path: Path, lines: Sequence[bytes]) -> None:
    with tempfile.NamedTemporaryFile(dir=path.parent, prefix=path.stem, suffix=".tmp", delete=False) as file:
        try:
            file.writelines(lines)
            file.flush()
            os.fsync(file.fileno())
            Path(file.name).chmod(0o644)
            Path(file.name).replace(path)
        except BaseException:
            Path(file.name).unlink(missing_ok=True)
            raise
