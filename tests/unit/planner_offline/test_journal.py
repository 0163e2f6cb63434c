"""The journal of what was learned: kept whole, refused by name where it is not."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from common.errors import ArtefactError
from services.planner.core.growth import Addition
from services.planner.offline.journal import Journal, journal_path

SHA = "ab" * 32
ONE = Addition(np.array([[0.1, 1 / 3], [np.pi, -0.2]]), np.array([[0, 10], [10, 11]], dtype=np.int32))
TWO = Addition(np.array([[0.5, 0.5]]), np.array([[3, 12], [11, 12]], dtype=np.int32))


@pytest.fixture
def empty(tmp_path: Path) -> Journal:
    return read(journal_path(tmp_path / "map-x.tolman", SHA))


def read(path: Path, sha256: str = SHA, n_neurons: int = 10, n_joints: int = 2) -> Journal:
    return Journal.read(path, sha256, n_neurons, n_joints)


@pytest.fixture
def two(empty: Journal) -> Journal:
    return empty.with_entry(7, "wave", "taught", ONE).with_entry(8, "", "repair", TWO)


def test_no_file_is_an_empty_journal(empty: Journal) -> None:
    assert (empty.entries, empty.n_added_neurons, empty.head) == ((), 0, "") and empty.addition.is_empty
    assert empty.path.name == f"learned-{SHA[:16]}.jsonl"


def test_what_is_read_is_what_was_written_bit_for_bit(two: Journal) -> None:
    again = read(two.path)
    assert [(e.number, e.learned_utc_ns, e.label, e.source) for e in again.entries] == [(1, 7, "wave", "taught"), (2, 8, "", "repair")]
    assert again.head == two.head and again.n_added_neurons == 3
    assert again.addition.neurons_rad.tobytes() == np.vstack([ONE.neurons_rad, TWO.neurons_rad]).tobytes()
    assert again.addition.edges.dtype == np.int32 and again.addition.edges.tolist() == [[0, 10], [10, 11], [3, 12], [11, 12]]


def test_reverting_keeps_the_first_entries(two: Journal) -> None:
    once = two.reverted(1)
    assert [e.label for e in read(two.path).entries] == ["wave"] and once.head == read(two.path).head
    assert once.reverted(0).entries == () and read(two.path).entries == ()


def test_one_who_does_not_know_its_end_may_not_write(two: Journal) -> None:
    stale = read(two.path)
    two.reverted(1)
    before = two.path.read_bytes()
    with pytest.raises(ArtefactError) as caught:
        stale.with_entry(9, "late", "taught", TWO)
    assert caught.value.code == "journal_changed" and two.path.read_bytes() == before


@pytest.mark.parametrize("at", [0.1, 0.5, 0.9, 0.999])
def test_a_torn_journal_is_refused_by_name_and_line(two: Journal, at: float) -> None:
    whole = two.path.read_bytes()
    two.path.write_bytes(whole[: int(at * len(whole))])
    with pytest.raises(ArtefactError) as caught:
        read(two.path)
    assert caught.value.code == "torn_journal"
    assert str(two.path) in caught.value.message and "line " in caught.value.message


def test_every_changed_byte_is_noticed(two: Journal) -> None:
    whole = two.path.read_bytes()
    for k in range(0, len(whole), 7):
        two.path.write_bytes(whole[:k] + bytes([whole[k] ^ 1]) + whole[k + 1 :])
        with pytest.raises(ArtefactError):
            read(two.path)


@pytest.mark.parametrize("content", [b"", b"\n", b"[]\n", b"7\n", b"\xff\xfe\x00", b'{"a": 1}\n', b"garbage"])
def test_garbage_is_refused(empty: Journal, content: bytes) -> None:
    empty.path.write_bytes(content)
    with pytest.raises(ArtefactError):
        read(empty.path)


def test_a_line_that_is_missing_is_noticed(two: Journal) -> None:
    lines = two.path.read_bytes().splitlines(keepends=True)
    two.path.write_bytes(lines[0] + lines[2])
    with pytest.raises(ArtefactError, match="line 2"):
        read(two.path)


def test_a_journal_of_another_map_is_refused(two: Journal) -> None:
    for changes in ({"sha256": "cd" * 32}, {"n_neurons": 11}, {"n_joints": 3}):
        with pytest.raises(ArtefactError) as caught:
            read(two.path, **changes)  # type: ignore[arg-type]
        assert caught.value.code == "foreign_journal" and str(two.path) in caught.value.message


def test_another_version_is_refused(empty: Journal, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.planner.offline.journal.VERSION", 99)
    theirs = empty.with_entry(1, "", "", ONE)
    monkeypatch.undo()
    with pytest.raises(ArtefactError) as caught:
        read(theirs.path)
    assert caught.value.code == "journal_version" and "99" in caught.value.message


@pytest.mark.parametrize(
    "addition",
    [
        Addition(ONE.neurons_rad, np.array([[0, 12]], dtype=np.int32)),
        Addition(ONE.neurons_rad, np.array([[-1, 10]], dtype=np.int32)),
        Addition(ONE.neurons_rad, np.array([[10, 10]], dtype=np.int32)),
        Addition(np.array([[np.nan, 0.0]]), np.empty((0, 2), dtype=np.int32)),
    ],
)
def test_entries_that_do_not_fit_the_map_are_refused(empty: Journal, addition: Addition) -> None:
    empty.with_entry(1, "", "", addition)
    with pytest.raises(ArtefactError, match=r"line 2.*entry 1"):
        read(empty.path)


def test_it_is_plain_text(two: Journal) -> None:
    header = json.loads(two.path.read_text().splitlines()[0])
    assert (header["format"], header["version"], header["map_sha256"]) == ("tolman-learned", 1, SHA)
