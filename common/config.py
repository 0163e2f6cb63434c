"""TOML files into strict frozen Structs: an unknown key, a missing key or a value out of range is an error that names its path.

One file describes one robot cell. The sections of :class:`common.cell.CellConfig` are shared by all processes; each service
owns one further section and parses it with its own type. ``extends = "FILE"`` takes over what FILE says and this file does not;
``--set section.key=value`` overrides single values.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from common.errors import ConfigError

__all__ = ["SERVICE_SECTIONS", "Strict", "config_of_robot", "load_tables", "parse", "plain", "robots"]

T = TypeVar("T")
SERVICE_SECTIONS = ("planner", "perception", "robot_sim", "cameras", "demo")
SHIPPED = Path(__file__).resolve().parent.parent / "deploy" / "config"
DEFAULT_CONFIG = SHIPPED / "ur3.toml"
EXTENDS = "extends"
MOST_EXTENSIONS = 8  # our choice: more is a file that extends itself


class Strict(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of all config structs: frozen, keyword only, unknown keys refused."""


def robots() -> list[str]:
    """Names of the arms that tolman has a cell for."""
    return sorted(path.stem for path in SHIPPED.glob("*.toml"))


def config_of_robot(name: str) -> Path:
    """The shipped cell config of an arm.

    Raises:
        ConfigError: no such arm; names those that there are.
    """
    known = robots()
    if name not in known:
        raise ConfigError(f"--robot {name}: no such arm; there are: {', '.join(known)}", code="unknown_robot", facts={"known": known})
    return SHIPPED / f"{name}.toml"


def load_tables(path: Path | None, overrides: list[str] | None = None) -> dict[str, Any]:
    """The raw tables of a config file with ``--set`` overrides applied.

    Args:
        path: TOML file; None means the UR3 cell that ships with tolman.
        overrides: ``section.key=value`` strings; the value is read as TOML and, failing that, as a plain string.

    Raises:
        ConfigError: file not found, not TOML, extends itself, or an override without a known place.
    """
    path = DEFAULT_CONFIG if path is None else path
    tables = _read(path)
    for _ in range(MOST_EXTENSIONS):
        base = tables.pop(EXTENDS, None)
        if base is None:
            break
        if not isinstance(base, str):
            raise ConfigError(f"{path}: {EXTENDS}: expected the name of a file, got {base!r}")
        path = path.parent / base
        tables = _merged(_read(path), tables)
    if EXTENDS in tables:
        raise ConfigError(f"{path}: {EXTENDS}: more than {MOST_EXTENSIONS} files, one in another: does one extend itself?")
    for override in overrides or []:
        _override(tables, override)
    return tables


def _read(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}", facts={"path": str(path)}) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: not valid TOML: {error}", facts={"path": str(path)}) from None


def _merged(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """``base`` with what ``over`` says: sections key by key, anything else (a list too) as a whole."""
    merged = dict(base)
    for key, value in over.items():
        is_section = isinstance(value, dict) and isinstance(merged.get(key), dict)
        merged[key] = _merged(merged[key], value) if is_section else value
    return merged


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
