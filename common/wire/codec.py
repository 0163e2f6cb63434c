"""MessagePack bytes <-> messages, arrays included. Anything that speaks MessagePack can speak this."""

from __future__ import annotations

import sys
import types
from functools import cache
from typing import Any, TypeVar

import msgspec
import numpy as np

from common.errors import WireError
from common.wire.messages import Message

__all__ = ["ENCODING_PREFIX", "array_to_map", "decode", "encode", "encoding_of", "map_to_array"]

M = TypeVar("M", bound=Message)
ENCODING_PREFIX = "application/msgpack;"
WIRE_DTYPES = ("<f8", "<f4", "<i4", "<u2", "|u1")
MAX_ARRAY_BYTES = 256 * 1024 * 1024  # our choice: no payload may make a service allocate without bound

if sys.byteorder != "little":  # pragma: no cover
    raise ImportError("tolman's wire format is little-endian and this build of the codec does not swap bytes")


def array_to_map(array: np.ndarray[Any, np.dtype[Any]]) -> dict[str, Any]:
    """``{"dtype", "shape", "data"}`` of an array: C order, little-endian.

    Raises:
        WireError: dtype is none of the contract's.
    """
    dtype = array.dtype.str
    if dtype not in WIRE_DTYPES:
        raise WireError(f"dtype {dtype} is not one of the wire's {WIRE_DTYPES}")
    return {"dtype": dtype, "shape": list(array.shape), "data": np.ascontiguousarray(array).tobytes()}


def map_to_array(value: Any, dtype: np.dtype[Any]) -> np.ndarray[Any, np.dtype[Any]]:
    """The array of a wire map or of plain (nested) lists of numbers, cast to ``dtype`` if no value is lost.

    Raises:
        WireError: malformed map, wrong byte count, ragged or non-numeric list, fractions where integers are due.
    """
    if isinstance(value, dict):
        array = _from_map(value)
    elif isinstance(value, list):
        try:
            array = np.asarray(value, dtype=np.float64)
        except (ValueError, TypeError, OverflowError) as error:
            raise WireError(f"a list where an array is due must hold numbers and be rectangular: {error}") from None
    else:
        raise WireError(f"an array must be a map with dtype, shape, data or a list of numbers, not {type(value).__name__}")
    if array.dtype == dtype:
        return array
    if dtype.kind in "iu":
        info = np.iinfo(dtype)
        if array.size and (
            not np.all(np.isfinite(array)) or np.any(array != np.floor(array)) or array.min() < info.min or array.max() > info.max
        ):
            raise WireError(f"values do not fit dtype {dtype.str}")
    return array.astype(dtype)


def _from_map(value: dict[Any, Any]) -> np.ndarray[Any, np.dtype[Any]]:
    try:
        dtype, shape, data = value["dtype"], value["shape"], value["data"]
    except KeyError as error:
        raise WireError(f"array map lacks {error}") from None
    if dtype not in WIRE_DTYPES:
        raise WireError(f"array dtype {dtype!r} is not one of {WIRE_DTYPES}")
    if not isinstance(shape, list) or not all(isinstance(n, int) and n >= 0 for n in shape):
        raise WireError(f"array shape {shape!r} is not a list of sizes")
    if not isinstance(data, bytes):
        raise WireError(f"array data must be binary, not {type(data).__name__}")
    expected = int(np.dtype(dtype).itemsize)
    for n in shape:  # Python integers: no overflow can make a huge shape look small
        expected *= n
    if expected != len(data) or expected > MAX_ARRAY_BYTES:
        raise WireError(f"array of dtype {dtype} and shape {shape} needs {expected} bytes, got {len(data)}")
    # A copy: a read-only view of the payload would make numba compile every kernel that it meets a second time.
    return np.frombuffer(data, dtype=np.dtype(dtype)).reshape(shape).copy()


def _encode_hook(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return array_to_map(value)
    if isinstance(value, np.generic):
        return value.item()
    raise NotImplementedError(f"{type(value).__name__} cannot travel")


def _decode_hook(kind: Any, value: Any) -> Any:
    if isinstance(kind, types.GenericAlias) and kind.__origin__ is np.ndarray:
        try:
            return map_to_array(value, np.dtype(kind.__args__[1].__args__[0]))
        except WireError as error:
            raise ValueError(error.message) from None  # msgspec adds the path of the field to a ValueError
    raise NotImplementedError(f"{kind} is not a wire type")


_ENCODER = msgspec.msgpack.Encoder(enc_hook=_encode_hook)


@cache
def _decoder(kind: type[Message]) -> msgspec.msgpack.Decoder[Any]:
    return msgspec.msgpack.Decoder(kind, dec_hook=_decode_hook)


def encode(message: Message) -> bytes:
    """The payload of a message."""
    return _ENCODER.encode(message)


def decode(payload: bytes, kind: type[M]) -> M:
    """The message of a payload.

    Raises:
        WireError: not MessagePack, a field missing or mistyped (the message names its path).
    """
    try:
        message: M = _decoder(kind).decode(payload)
    except (msgspec.DecodeError, ValueError, RecursionError, OverflowError) as error:
        raise WireError(f"{kind.__name__}: {error}") from None
    return message


def encoding_of(kind: type[Message]) -> str:
    """Zenoh encoding of a message: ``application/msgpack;<Message>``."""
    return ENCODING_PREFIX + WIRE_NAMES.get(kind.__name__, kind.__name__)


WIRE_NAMES = {"GridInfo": "Grid"}
