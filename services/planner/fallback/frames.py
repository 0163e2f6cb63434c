"""What the planner and its fallback process say to one another: frames of MessagePack over a pipe, each after its length."""

from __future__ import annotations

import struct
from typing import IO, Any

import msgspec

from common.cell import CellConfig
from services.planner.config import MarginsConfig
from services.planner.fallback.carried_map import CarriedMap

__all__ = ["Alive", "Answer", "Asked", "Held", "Ready", "Setting", "Withdrawn", "read_frame", "write_frame"]

LENGTH = struct.Struct("<I")


class _Frame(msgspec.Struct, frozen=True, tag=True):
    """One frame; the kind travels with it."""


class Setting(_Frame, frozen=True, tag=True):
    """First of all: the cell and the margins that hold from now on."""

    cell: CellConfig
    margins: MarginsConfig


class Ready(_Frame, frozen=True, tag=True):
    """The process has compiled everything and answers."""


class Alive(_Frame, frozen=True, tag=True):
    """The process still works on what it was asked."""


class Held(msgspec.Struct, frozen=True):
    """A box in the gripper, as :class:`~common.robot.payload.Payload`."""

    size_m: tuple[float, float, float]
    position_m: tuple[float, float, float]
    quaternion_xyzw: tuple[float, float, float, float]


class Asked(_Frame, frozen=True, tag=True):
    """A question: start (J,) and goals (G, J) in rad, occupied cells as little-endian int32, state of the generator.

    ``max_iterations``: samples at most of each of ``n_searches`` searches. ``held``: what the gripper holds. ``known``: the map, for
    every second search.
    """

    id: int
    q_start_rad: list[float]
    q_goals_rad: list[list[float]]
    cells: bytes
    seed: list[int]
    max_iterations: int
    n_searches: int = 1
    held: Held | None = None
    known: CarriedMap | None = None


class Withdrawn(_Frame, frozen=True, tag=True):
    """The answer to that question is not wanted any more."""

    id: int


class Answer(_Frame, frozen=True, tag=True):
    """The way (P, J) in rad, None if there is none within the bound; how many samples and milliseconds of work it took."""

    id: int
    q_rad: list[list[float]] | None
    iterations: int
    ms: float


_decoder = msgspec.msgpack.Decoder(Setting | Ready | Alive | Asked | Withdrawn | Answer)


def write_frame(pipe: IO[bytes], frame: _Frame) -> None:
    """Send one frame; OSError if the other side is gone."""
    payload = msgspec.msgpack.encode(frame)
    pipe.write(LENGTH.pack(len(payload)) + payload)
    pipe.flush()


def read_frame(pipe: IO[bytes]) -> Any:
    """The next frame; None at the end of the pipe (the other side is gone, perhaps in the middle of a frame) or where it makes no sense."""
    head = pipe.read(LENGTH.size)
    if len(head) < LENGTH.size:
        return None
    (length,) = LENGTH.unpack(head)
    payload = pipe.read(length)
    try:
        return _decoder.decode(payload) if len(payload) == length else None
    except msgspec.DecodeError:
        return None
