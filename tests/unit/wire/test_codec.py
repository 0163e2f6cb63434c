"""Bytes and messages: round trips, plain MessagePack on the other side, and bad payloads that end in WireError alone."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import hypothesis.strategies as st
import msgpack
import numpy as np
import pytest
from hypothesis import given, settings

from common.errors import WireError
from common.wire.codec import array_to_map, decode, encode, encoding_of, map_to_array
from common.wire.messages import GridInfo, Message, PlanRequest, RobotState, SetGoal, Trajectory
from tests.support.messages import ALL_MESSAGES, messages_of, same

ANY_MESSAGE = st.sampled_from(ALL_MESSAGES).flatmap(messages_of)
GOAL = SetGoal(q_rad=np.array([0.1, -0.2, 0.3]))


def as_lists(value: Any) -> Any:
    """Array maps as nested lists, as a client without numpy would send them."""
    if isinstance(value, dict) and set(value) == {"dtype", "shape", "data"}:
        return np.frombuffer(value["data"], dtype=value["dtype"]).reshape(value["shape"]).tolist()
    if isinstance(value, dict):
        return {key: as_lists(item) for key, item in value.items()}
    return [as_lists(item) for item in value] if isinstance(value, list) else value


@pytest.mark.parametrize("kind", ALL_MESSAGES, ids=lambda kind: kind.__name__)
@given(data=st.data())
@settings(max_examples=25, deadline=None)
def test_a_message_survives_the_wire(kind: type[Message], data: st.DataObject) -> None:
    message = data.draw(messages_of(kind))
    assert same(decode(encode(message), kind), message)


@given(ANY_MESSAGE)
@settings(deadline=None)
def test_plain_msgpack_reads_and_writes_it(message: Message) -> None:
    as_map = msgpack.unpackb(encode(message))
    assert set(as_map) == set(message.__struct_fields__)
    assert same(decode(msgpack.packb(as_map), type(message)), message)


def test_lists_are_taken_for_arrays() -> None:
    payload = msgpack.packb({"q_start_rad": [0, 1.5, 2], "goal": {"q_rad": [1, 2, 3]}, "cells": [5, 7]})
    request = decode(payload, PlanRequest)
    assert request.q_start_rad is not None
    assert request.q_start_rad.dtype == np.float64
    assert request.q_start_rad.tolist() == [0.0, 1.5, 2.0]
    assert request.cells is not None
    assert request.cells.dtype == np.int32


@given(messages_of(Trajectory))
@settings(deadline=None, max_examples=30)
def test_nested_lists_of_two_dimensional_arrays(trajectory: Message) -> None:
    wire = msgpack.unpackb(encode(trajectory))
    wire["q_rad"] = {"dtype": "<f8", "shape": [2, 3], "data": np.arange(6.0).tobytes()}
    assert same(decode(msgpack.packb(as_lists(wire)), Trajectory).q_rad, decode(msgpack.packb(wire), Trajectory).q_rad)


@given(st.binary(max_size=200), st.sampled_from(ALL_MESSAGES))
@settings(max_examples=400, deadline=None)
def test_garbage_raises_wire_error_or_nothing(payload: bytes, kind: type[Message]) -> None:
    with suppress(WireError):
        decode(payload, kind)


@given(ANY_MESSAGE, st.data())
@settings(max_examples=300, deadline=None)
def test_a_damaged_message_raises_wire_error_or_nothing(message: Message, data: st.DataObject) -> None:
    payload = bytearray(encode(message))
    for _ in range(data.draw(st.integers(1, 4))):
        payload[data.draw(st.integers(0, len(payload) - 1))] = data.draw(st.integers(0, 255))
    end = data.draw(st.integers(0, len(payload)))
    with suppress(WireError):
        decode(bytes(payload[:end]), type(message))


JUNK = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats() | st.text(max_size=4) | st.binary(max_size=16),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(["dtype", "shape", "data", "x"]), inner, max_size=4),
    max_leaves=12,
)


@given(JUNK)
@settings(max_examples=400, deadline=None)
def test_junk_where_an_array_is_due_raises_wire_error_or_nothing(junk: Any) -> None:
    with suppress(WireError):
        decode(msgpack.packb({"q_rad": junk}), SetGoal)


@pytest.mark.parametrize(
    ("shape", "data", "dtype"),
    [
        ([3], b"\0" * 16, "<f8"),
        ([2**40, 2**40], b"", "<f8"),
        ([0, 2**64 - 1], b"", "<f8"),
        ([1] * 80, b"\0" * 8, "<f8"),
        ([-1], b"\0" * 8, "<f8"),
        ([1.0], b"\0" * 8, "<f8"),
        ([1], b"\0" * 8, ">f8"),
        ([1], b"\0" * 8, "O"),
        ([1], "eight ch", "<f8"),
        ("1", b"\0" * 8, "<f8"),
        ([1], b"\0" * 8, ["<f8"]),
    ],
)
def test_a_malformed_array_map_is_refused(shape: Any, data: Any, dtype: Any) -> None:
    payload = msgpack.packb({"q_rad": {"dtype": dtype, "shape": shape, "data": data}})
    with pytest.raises(WireError):
        decode(payload, SetGoal)


@pytest.mark.parametrize("values", [[0.5], [float("nan")], [float("inf")], [2**31], [-(2**31) - 1]])
def test_integers_are_not_made_of_what_is_none(values: list[float]) -> None:
    with pytest.raises(WireError, match="cells"):
        decode(msgpack.packb({"goal": {"name": "home"}, "cells": values}), PlanRequest)


def test_an_error_names_message_and_place() -> None:
    with pytest.raises(WireError, match=r"PlanRequest.*\$\.goal\.q_rad"):
        decode(msgpack.packb({"goal": {"q_rad": "north"}}), PlanRequest)
    with pytest.raises(WireError, match="goal"):
        decode(msgpack.packb({}), PlanRequest)


def test_unknown_fields_are_ignored_and_missing_ones_refused() -> None:
    known = msgpack.unpackb(encode(GOAL))
    assert same(decode(msgpack.packb({**known, "field_of_tomorrow": [1, {"a": 2}]}), SetGoal), GOAL)
    with pytest.raises(WireError, match="dq_rad_s"):
        decode(msgpack.packb({"q_rad": [0.0]}), RobotState)


def test_deep_nesting_is_refused() -> None:
    with pytest.raises(WireError):
        decode(b"\x81\xa5q_rad" + b"\x91" * 200_000 + b"\xc0", SetGoal)


def test_arrays_keep_order_when_they_are_views() -> None:
    grid = np.arange(12.0).reshape(3, 4)
    for view in (grid.T, grid[::2], np.asfortranarray(grid)):
        assert np.array_equal(map_to_array(array_to_map(view), np.dtype("<f8")), view)


def test_encoding_names_the_message_of_the_contract() -> None:
    assert encoding_of(RobotState) == "application/msgpack;RobotState"
    assert encoding_of(GridInfo) == "application/msgpack;Grid"
