"""docs/protocol.md says what the code says: keys, kinds, messages, fields, which of them may be absent, and every enumeration."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal, get_args, get_origin

import msgspec
import pytest

from common.wire import codec, keys, messages

TEXT = (Path(__file__).parents[2] / "docs" / "protocol.md").read_text(encoding="utf-8")
HEADER = {"stamp_ns", "epoch", "seq"}
FIELD = re.compile(r"`([A-Za-z_]\w*)(\[[\w,]+\])?(\?)?`")


def rows(section: str) -> list[list[str]]:
    """Cells of the table rows under a heading, without the table's head."""
    body = TEXT.split(f"\n## {section}\n")[1].split("\n## ")[0]
    lines = [line for line in body.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in lines[2:]]


def wire_name(kind: type[messages.Message]) -> str:
    return codec.WIRE_NAMES.get(kind.__name__, kind.__name__)


def message_types() -> dict[str, type[messages.Message]]:
    kinds = [value for value in vars(messages).values() if isinstance(value, type) and issubclass(value, messages.Message)]
    return {wire_name(kind): kind for kind in kinds if kind not in (messages.Message, messages.State)}


def literals_of(annotation: object) -> list[set[str]]:
    """The enumerations within a type, at most one here."""
    if get_origin(annotation) is Literal:
        return [set(get_args(annotation))]
    return [found for argument in get_args(annotation) for found in literals_of(argument)]


def described_fields(cell: str) -> dict[str, tuple[bool, set[str]]]:
    """Field -> (may be absent, enumeration that follows it in brackets). Backticks inside brackets are enumeration values."""
    out: dict[str, tuple[bool, set[str]]] = {}
    plain = re.sub(r"\([^)]*\)", lambda match: " " * len(match[0]), cell)
    for match in FIELD.finditer(plain):
        rest = cell[match.end() :]
        bracket = re.match(r"(?:: list of)? \((`\w+`(?: `\w+`)*)\)", rest)
        out[match[1]] = (match[3] == "?", set(re.findall(r"`(\w+)`", bracket[1])) if bracket else set())
    return out


def test_every_key_of_the_code_is_described_and_the_other_way_round() -> None:
    described = {row[0].strip("`"): tuple(row[1:4]) for row in rows("Keys")}
    coded = {c.key: (c.kind.value, wire_name(c.message), wire_name(c.reply) if c.reply else "") for c in keys.CHANNELS}
    assert described == coded


@pytest.mark.parametrize("channel", [c for c in keys.CHANNELS if c.kind is keys.Kind.STATE], ids=lambda c: c.key)
def test_rates_and_losslessness_are_described(channel: keys.Channel) -> None:
    row = next(row for row in rows("Keys") if row[0] == f"`{channel.key}`")
    rate = re.match(r"(\d+) Hz", row[4])
    assert (float(rate[1]) if rate else None) == channel.rate_hz
    assert row[5] == ("never dropped" if channel.lossless else "latest wins")


def test_every_message_of_the_code_is_described_and_the_other_way_round() -> None:
    assert {row[0] for row in rows("Messages")} == set(message_types())


@pytest.mark.parametrize("name", sorted(message_types()))
def test_fields_absences_and_enumerations_agree(name: str) -> None:
    kind = message_types()[name]
    row = next(row for row in rows("Messages") if row[0] == name)
    is_state = issubclass(kind, messages.State)
    assert (row[1] == "state") == is_state
    header = HEADER if is_state else set()
    described = {field: value for field, value in described_fields(row[2]).items() if field not in header}
    coded = {}
    for field in msgspec.structs.fields(kind):
        if field.name in header:
            continue
        enumerations = literals_of(field.type)
        coded[field.name] = (not field.required, enumerations[0] if enumerations else set())
    assert described == coded


def test_owners_are_described() -> None:
    sentence = re.search(r"Owners are (.*?)\. ", TEXT)
    assert sentence is not None
    assert tuple(re.findall(r"`(\w+)`", sentence[1])) == keys.OWNERS


def test_array_dtypes_are_described() -> None:
    quoted = re.search(r'"dtype": (.*?), "shape"', TEXT)
    assert quoted is not None
    assert tuple(re.findall(r'"([^"]+)"', quoted[1])) == codec.WIRE_DTYPES
