"""Taught motions as files: what ``tolman teach`` records, ``tolman build --motions`` trains on and ``planner/learn`` is given.

JSON, so that anyone can read and write one: ``format``, ``version``, ``robot`` (name and fingerprint), ``joint_names``, ``t_s`` (K,) and
``q_rad`` (K, J), ``label``. Written whole or not at all; everything is checked on reading, against the arm that it shall move.
"""

from __future__ import annotations

import json
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from common.errors import ArtefactError
from common.robot.model import RobotModel

__all__ = ["FORMAT", "VERSION", "TaughtMotion", "read_taught", "write_taught"]

F64 = NDArray[np.float64]
FORMAT = "tolman-taught"
VERSION = 1  # raise when the meaning of a field changes
LIMIT_TOLERANCE_RAD = 1e-3  # a measured joint may be this far beyond a limit that its reference keeps; it is put back on it; our choice


@dataclass(frozen=True, eq=False)
class TaughtMotion:
    """``t_s`` (K,) strictly increasing seconds, ``q_rad`` (K, J), K >= 2, and what it is called."""

    t_s: F64
    q_rad: F64
    label: str = ""


def write_taught(path: Path, motion: TaughtMotion, robot: RobotModel) -> None:
    """Write a motion of ``robot``. Readers see the old file or the new one, never a part.

    Raises:
        ArtefactError: it would not be read back: shapes, limits or times.
        OSError: the disk says no.
    """
    content = {
        "format": FORMAT,
        "version": VERSION,
        "robot": {"name": robot.name, "fingerprint": robot.fingerprint},
        "joint_names": list(robot.joint_names),
        "label": motion.label,
        "t_s": motion.t_s.tolist(),
        "q_rad": motion.q_rad.tolist(),
    }
    _checked(path, content, robot)
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile("w", dir=path.parent, prefix=path.stem, suffix=".tmp", delete=False, encoding="utf-8") as file:
        try:
            json.dump(content, file)
            file.flush()
            os.fsync(file.fileno())
            Path(file.name).chmod(0o644)
            Path(file.name).replace(path)
        except BaseException:
            Path(file.name).unlink(missing_ok=True)
            raise


def read_taught(path: Path, robot: RobotModel) -> TaughtMotion:
    """The motion in a file, for ``robot``.

    Raises:
        ArtefactError: with code ``missing_motion``, ``torn_motion``, ``motion_version``, ``foreign_motion`` or ``bad_motion``; names the
            file, the place in it and the value.
    """
    try:
        content = json.loads(path.read_bytes())
    except OSError as error:
        raise ArtefactError(f"{path}: cannot be read: {error.strerror}", code="missing_motion", facts={"path": str(path)}) from None
    except (ValueError, RecursionError) as error:
        raise ArtefactError(f"{path}: torn or no JSON: {error}", code="torn_motion", facts={"path": str(path)}) from None
    return _checked(path, content, robot)


def _checked(path: Path, content: Any, robot: RobotModel) -> TaughtMotion:
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        found = content.get("format") if isinstance(content, dict) else type(content).__name__
        raise _bad(path, "format", f"{found!r}, expected {FORMAT!r}", "torn_motion")
    if content.get("version") != VERSION:
        raise _bad(path, "version", f"{content.get('version')!r}, this tolman reads {VERSION}", "motion_version")
    made_for = content.get("robot")
    fingerprint = made_for.get("fingerprint") if isinstance(made_for, dict) else None
    if fingerprint != robot.fingerprint:
        raise _bad(path, "robot.fingerprint", f"{fingerprint!r}, the arm is {robot.name} {robot.fingerprint!r}", "foreign_motion")
    if content.get("joint_names") != list(robot.joint_names):
        raise _bad(path, "joint_names", f"{content.get('joint_names')!r}, the arm has {list(robot.joint_names)!r}", "foreign_motion")
    label = content.get("label", "")
    if not isinstance(label, str):
        raise _bad(path, "label", f"{label!r} is not text")
    q = _numbers(path, content, "q_rad")
    if q.ndim != 2 or q.shape[1] != robot.n_joints or len(q) < 2:
        raise _bad(path, "q_rad", f"shape {list(q.shape)}, expected (K >= 2, {robot.n_joints})")
    t = _numbers(path, content, "t_s")
    if t.shape != (len(q),):
        raise _bad(path, "t_s", f"shape {list(t.shape)}, expected [{len(q)}] as q_rad has")
    _check_times(path, t)
    return TaughtMotion(t, _within_limits(path, q, robot), label)


def _numbers(path: Path, content: dict[str, Any], name: str) -> F64:
    try:
        return np.array(content.get(name, []), dtype=np.float64)
    except (ValueError, TypeError, OverflowError) as error:
        raise _bad(path, name, f"must be numbers in rows of one length: {error}") from None


def _check_times(path: Path, t: F64) -> None:
    later = np.concatenate([[np.isfinite(t[0])], np.diff(t) > 0.0]) & np.isfinite(t)
    if not later.all():
        k = int(np.argmin(later))
        raise _bad(path, f"t_s[{k}]", f"{t[k]} is not after the one before")


def _within_limits(path: Path, q: F64, robot: RobotModel) -> F64:
    kept = np.clip(q, robot.position_min_rad, robot.position_max_rad)
    near = np.abs(kept - q) <= LIMIT_TOLERANCE_RAD  # false for what is not a number, too
    if not near.all():
        k = int(np.argmin(near.all(axis=1)))
        raise _bad(path, f"q_rad[{k}]", str(robot.limit_violation(q[k])))
    return kept


def _bad(path: Path, place: str, what: str, code: str = "bad_motion") -> ArtefactError:
    return ArtefactError(f"{path}: {place}: {what}", code=code, facts={"path": str(path), "place": place})
