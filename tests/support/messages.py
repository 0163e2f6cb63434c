"""Hypothesis strategies for every message of the wire, made from the types themselves, and the equality of messages with arrays."""

from __future__ import annotations

import types
from typing import Any, Literal, Union, get_args, get_origin

import hypothesis.strategies as st
import msgspec
import numpy as np
from hypothesis.extra import numpy as hnp

from common.wire import messages

ALL_MESSAGES: tuple[type[messages.Message], ...] = tuple(
    sorted(
        (
            value
            for value in vars(messages).values()
            if isinstance(value, type) and issubclass(value, messages.Message) and value not in (messages.Message, messages.State)
        ),
        key=lambda kind: kind.__name__,
    )
)
FACTS = st.one_of(st.none(), st.booleans(), st.integers(-(2**63), 2**63 - 1), st.floats(allow_nan=False), st.text(max_size=8))
SCALARS: dict[Any, st.SearchStrategy[Any]] = {
    int: st.integers(-(2**63), 2**63 - 1),
    float: st.floats(allow_nan=False),
    str: st.text(max_size=12),
    bool: st.booleans(),
    type(None): st.none(),
    Any: FACTS,
}


def values_of(annotation: Any) -> st.SearchStrategy[Any]:
    """Values of a field's type."""
    if annotation in SCALARS:
        return SCALARS[annotation]
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is np.ndarray:
        dtype = np.dtype(arguments[1].__args__[0])
        shapes = hnp.array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=4)
        return hnp.arrays(dtype, shapes, elements=None if dtype.kind in "iu" else st.floats(allow_nan=False))
    if origin is Literal:
        return st.sampled_from(arguments)
    if origin in (Union, types.UnionType):
        return st.one_of(*(values_of(argument) for argument in arguments))
    if origin is list:
        return st.lists(values_of(arguments[0]), max_size=3)
    if origin is dict:
        return st.dictionaries(values_of(arguments[0]), values_of(arguments[1]), max_size=3)
    return messages_of(annotation)


def messages_of(kind: type[messages.Message]) -> st.SearchStrategy[messages.Message]:
    """Messages of a type, all fields given."""
    return st.builds(kind, **{field.name: values_of(field.type) for field in msgspec.structs.fields(kind)})


def same(a: Any, b: Any) -> bool:
    """Equal, arrays by dtype, shape and bytes."""
    if isinstance(a, messages.Message):
        return type(a) is type(b) and all(same(getattr(a, name), getattr(b, name)) for name in a.__struct_fields__)
    if isinstance(a, np.ndarray):
        return isinstance(b, np.ndarray) and a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, list):
        return isinstance(b, list) and len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, dict):
        return isinstance(b, dict) and a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    return bool(a == b)
