"""TOML files into strict frozen Structs: an unknown key, a missing key or a value out of range is an error that names its path.

One file describes one robot cell. The sections of :class:`common.cell.CellConfig` are shared by all processes; each service
owns one further section and parses it with its own type. ``--set section.key=value`` overrides single values.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from common.errors import ConfigError

__all__ = ["SERVICE_SECTIONS", "Strict", "load_tables", "parse", "plain"]

T = TypeVar("T")
SERVICE_SECTIONS = ("planner", "perception", "robot_sim", "cameras", "demo")
DEFAULT_CONFIG = Path(__file__).resolve().parent.parent / "deploy" / "config" / "ur3.toml"


class Strict(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of all config structs: frozen, keyword only, unknown keys refused."""


def load_tables(path: Path | None, overrides: list[str] | None = None) -> dict[str, Any]:
    """The raw tables of a config file with ``--set`` overrides applied.

    Args:
        path: TOML file; None means the UR3 cell that ships with tolman.
        overrides: ``section.key=value`` strings; the value is read as TOML and, failing that, as a plain string.

    Raises:
        ConfigError: file not found, not TOML, or an override without a known place.
    """
    path = DEFAULT_CONFIG if path is None else path
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}", facts={"path": str(path)}) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: not valid TOML: {error}", facts={"path": str(path)}) from None
    for override in overrides or []:
        _override(tables, override)
    return tables


def _override(tables: dict[str, Any], override: str) -> None:
    key, separator, text = override.partition("=")
    if not separator:
        raise ConfigError(f"--set {override}: expected KEY=VALUE")
    try:
        value = tomllib.loads(f"v = {text}")["v"]
    except tomllib.TOMLDecodeError:
        value = text
    *parents, last = key.strip().split(".")
    table = tables
    for parent in parents:
        table = table.setdefault(parent, {})
        if not isinstance(table, dict):
            raise ConfigError(f"--set {override}: {parent} is a value, not a section")
    table[last] = value


def parse(table: Any, kind: type[T], *, place: str) -> T:
    """One table into its type.

    Raises:
        ConfigError: the message names ``place`` and the path of the offending key.
    """
    try:
        return msgspec.convert(table, kind, strict=True)
    except msgspec.ValidationError as error:
        raise ConfigError(f"{place}: {error}", facts={"place": place}) from None


def plain(config: Any) -> Any:
    """A config as plain data, for ``<owner>/info`` and reports."""
    return msgspec.to_builtins(config)
