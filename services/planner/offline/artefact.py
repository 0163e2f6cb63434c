"""The one file that a build makes: named arrays and plain metadata, versioned, checked, written whole or not at all.

Layout: 8 bytes magic, 32 bytes SHA-256 of all that follows, uint64 length of the header, header (JSON), arrays one after the other. All
little-endian; the header names version, fingerprints, and every array's dtype, shape and place. Nothing in it depends on when or where it
was written, so equal content is equal bytes; numpy's npz would carry times, pickle could carry code.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from common.errors import ArtefactError

__all__ = ["VERSION", "Artefact", "read", "write"]

VERSION = 2  # raise when the meaning of an array changes; 2: layers of clearance
MAGIC = b"tolman\x00\x01"
DIGEST_BYTES = 32  # SHA-256
PREFIX_BYTES = len(MAGIC) + DIGEST_BYTES + 8  # what stands before the header
ALIGNMENT = 64  # bytes; arrays start on multiples of it
KINDS = "biuf"  # bool, integers, floats


@dataclass(frozen=True, eq=False)
class Artefact:
    """Arrays by name, fingerprints by what they are of (``robot``, ``grid``, ``config``), and figures of the build."""

    arrays: Mapping[str, NDArray[Any]]
    fingerprints: Mapping[str, str]
    figures: Mapping[str, Any] = field(default_factory=dict)


def write(path: Path, artefact: Artefact) -> str:
    """Write ``artefact`` and return the SHA-256 of the file's bytes. Readers see the old file or the new one, never a part.

    Raises:
        ArtefactError: an array of objects or the like.
        OSError: the disk says no.
    """
    arrays = {name: _plain(name, array) for name, array in artefact.arrays.items()}
    header, blocks = _header(arrays, artefact)
    rest = [len(header).to_bytes(8, "little"), header, *blocks]
    inner = hashlib.sha256()
    for block in rest:
        inner.update(block)
    outer = hashlib.sha256()
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(dir=path.parent, prefix=path.stem, suffix=".tmp", delete=False) as file:
        try:
            for block in [MAGIC, inner.digest(), *rest]:
                outer.update(block)
                file.write(block)
            file.flush()
            os.fsync(file.fileno())
            Path(file.name).chmod(0o644)
            Path(file.name).replace(path)
        except BaseException:
            Path(file.name).unlink(missing_ok=True)
            raise
    return outer.hexdigest()


def read(path: Path, expected: Mapping[str, str]) -> Artefact:
    """Read a file and make sure that it is whole and that its fingerprints are those of ``expected``.

    Raises:
        ArtefactError: with code ``missing_artefact``, ``torn_artefact``, ``artefact_version`` or ``foreign_artefact``; the message names
            the file and what differs, ``facts`` has both values.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ArtefactError(f"{path}: cannot be read: {error.strerror}", code="missing_artefact", facts={"path": str(path)}) from None
    header, body = _split(path, data)
    if header.get("version") != VERSION:
        facts = {"path": str(path), "found": str(header.get("version")), "expected": str(VERSION)}
        raise ArtefactError(f"{path}: version {header.get('version')}, this tolman reads {VERSION}", code="artefact_version", facts=facts)
    for what, value in expected.items():
        found = header["fingerprints"].get(what, "none")
        if found != value:
            facts = {"path": str(path), "what": what, "found": found, "expected": value}
            raise ArtefactError(
                f"{path}: made for another {what}: fingerprint {found}, expected {value}; run `tolman build`",
                code="foreign_artefact",
                facts=facts,
            )
    arrays = {entry["name"]: _array(body, entry) for entry in header["arrays"]}
    return Artefact(arrays, header["fingerprints"], header["figures"])


def _plain(name: str, array: NDArray[Any]) -> NDArray[Any]:
    array = np.asarray(array)
    if array.dtype.kind not in KINDS:
        raise ArtefactError(f"artefact: array {name} has dtype {array.dtype}, only numbers can be kept", facts={"name": name})
    return np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<")).reshape(array.shape)


def _header(arrays: Mapping[str, NDArray[Any]], artefact: Artefact) -> tuple[bytes, list[bytes]]:
    entries, blocks, offset = [], [], 0
    for name in sorted(arrays):
        data = arrays[name].tobytes()
        data += bytes(-len(data) % ALIGNMENT)
        entries.append({"name": name, "dtype": arrays[name].dtype.str, "shape": list(arrays[name].shape), "offset": offset})
        blocks.append(data)
        offset += len(data)
    header = {
        "version": VERSION,
        "fingerprints": dict(artefact.fingerprints),
        "figures": dict(artefact.figures),
        "arrays": entries,
    }
    text = json.dumps(header, sort_keys=True, separators=(",", ":")).encode()
    text += b" " * (-(PREFIX_BYTES + len(text)) % ALIGNMENT)
    return text, blocks


def _split(path: Path, data: bytes) -> tuple[dict[str, Any], memoryview]:
    if data[: len(MAGIC)] != MAGIC:
        raise _torn(path, "it does not begin as a tolman artefact")
    rest = memoryview(data)[len(MAGIC) + DIGEST_BYTES :]
    if hashlib.sha256(rest).digest() != data[len(MAGIC) : len(MAGIC) + DIGEST_BYTES]:
        raise _torn(path, "its bytes do not have the SHA-256 that it begins with")
    length = int.from_bytes(rest[:8], "little")
    header: dict[str, Any] = json.loads(bytes(rest[8 : 8 + length]))
    return header, rest[8 + length :]


def _array(body: memoryview, entry: Mapping[str, Any]) -> NDArray[Any]:
    dtype = np.dtype(entry["dtype"])
    count = int(np.prod(entry["shape"], dtype=np.int64))
    view = np.frombuffer(body, dtype=dtype, count=count, offset=entry["offset"]).reshape(entry["shape"])
    return view.copy()  # writable, as the arrays that were written: kernels are compiled once for both


def _torn(path: Path, why: str) -> ArtefactError:
    return ArtefactError(
        f"{path}: torn or no artefact: {why}; run `tolman build`", code="torn_artefact", facts={"path": str(path), "why": why}
    )
