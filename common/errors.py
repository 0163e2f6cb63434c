"""The errors of tolman: each says the place, the value and a stable code.

Expected outcomes (no path, goal blocked) are values, never exceptions. An exception means that a contract was broken: by a
config file, by a payload, by an artefact. ``facts`` carries the values so that a client can act on them without parsing prose.
"""

from __future__ import annotations

from collections.abc import Mapping

__all__ = ["ArtefactError", "ConfigError", "RequestError", "RobotError", "TolmanError", "WireError"]

Fact = str | int | float | bool | None | list[float] | list[str] | list[int]


class TolmanError(Exception):
    """Base of all errors raised on purpose.

    Attributes:
        code: stable snake_case word, part of the wire contract (``{"code", "message", "facts"}``).
        message: one sentence for a person, naming place and value.
        facts: the same as data.
    """

    code = "error"

    def __init__(self, message: str, *, code: str | None = None, facts: Mapping[str, Fact] | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.facts: dict[str, Fact] = dict(facts or {})
        if code is not None:
            self.code = code


class ConfigError(TolmanError):
    """A config file has an unknown key, a missing key, or a value out of range."""

    code = "config"


class RobotError(TolmanError):
    """A robot description cannot be used: file not found, not a serial arm, a mesh missing."""

    code = "robot"


class ArtefactError(TolmanError):
    """A cognitive map file is torn, of another version, or belongs to another robot, grid or config."""

    code = "artefact"


class WireError(TolmanError):
    """A payload cannot be decoded: not MessagePack, a field missing or mistyped, an array malformed."""

    code = "bad_payload"


class RequestError(TolmanError):
    """A well-formed command asks for what cannot be done (out of limits, unknown id, wrong length)."""

    code = "bad_request"
