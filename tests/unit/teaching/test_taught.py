"""Taught files: what is written is read, everything else is refused by file, place and value."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from common.errors import ArtefactError
from common.robot.taught import TaughtMotion, read_taught, write_taught
from tests.support.cell import ur3

ROBOT = ur3()
MOTION = TaughtMotion(np.array([0.0, 0.008, 0.0171]), ROBOT.home_rad + np.array([[0.0], [1 / 3], [0.7]]) * 0.1, "wave")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_taught(tmp_path / "wave.json", MOTION, ROBOT)
    return tmp_path / "wave.json"


def test_what_is_read_is_what_was_written_bit_for_bit(path: Path) -> None:
    again = read_taught(path, ROBOT)
    assert again.q_rad.tobytes() == MOTION.q_rad.tobytes() and again.t_s.tobytes() == MOTION.t_s.tobytes() and again.label == "wave"
    assert [p.name for p in path.parent.iterdir()] == ["wave.json"]  # nothing half written is left


def test_it_says_what_it_is(path: Path) -> None:
    content = json.loads(path.read_text())
    assert (content["format"], content["version"]) == ("tolman-taught", 1)
    assert content["robot"] == {"name": "ur3", "fingerprint": ROBOT.fingerprint} and content["joint_names"] == list(ROBOT.joint_names)


def rows(row: int, column: int, value: Any) -> list[list[Any]]:
    q = MOTION.q_rad.tolist()
    q[row][column] = value
    return q


@pytest.mark.parametrize(
    ("changes", "code", "words"),
    [
        ({"format": "other"}, "torn_motion", ["format", "'other'"]),
        ({"version": 2}, "motion_version", ["version", "2"]),
        ({"robot": {"name": "ur3", "fingerprint": "beef"}}, "foreign_motion", ["robot.fingerprint", "beef", ROBOT.fingerprint]),
        ({"robot": "ur3"}, "foreign_motion", ["robot.fingerprint"]),
        ({"joint_names": ["a"] * 6}, "foreign_motion", ["joint_names", "'a'"]),
        ({"label": 7}, "bad_motion", ["label", "7"]),
        ({"q_rad": [[0.0] * 5] * 3}, "bad_motion", ["q_rad", "[3, 5]"]),
        ({"q_rad": [[0.0] * 6]}, "bad_motion", ["q_rad", "[1, 6]"]),
        ({"q_rad": [[0.0] * 6, [0.0] * 5]}, "bad_motion", ["q_rad"]),
        ({"q_rad": "x"}, "bad_motion", ["q_rad"]),
        ({"q_rad": rows(1, 2, None)}, "bad_motion", ["q_rad[1]", "elbow_joint", "nan"]),
        ({"q_rad": rows(2, 0, 9.0)}, "bad_motion", ["q_rad[2]", "shoulder_pan_joint", "9 rad"]),
        ({"q_rad": rows(0, 5, float("inf"))}, "bad_motion", ["q_rad[0]", "inf"]),
        ({"t_s": [0.0, 0.1]}, "bad_motion", ["t_s", "[2]", "[3]"]),
        ({"t_s": [0.0, 0.2, 0.2]}, "bad_motion", ["t_s[2]", "0.2"]),
        ({"t_s": [0.0, float("nan"), 0.2]}, "bad_motion", ["t_s[1]", "nan"]),
        ({"t_s": [float("nan"), 0.1, 0.2]}, "bad_motion", ["t_s[0]", "nan"]),
        ({"t_s": {}}, "bad_motion", ["t_s"]),
    ],
)
def test_a_bad_file_is_refused_by_place_and_value(path: Path, changes: dict[str, Any], code: str, words: list[str]) -> None:
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))
    with pytest.raises(ArtefactError) as caught:
        read_taught(path, ROBOT)
    assert caught.value.code == code
    for word in [str(path), *words]:
        assert word in caught.value.message


@pytest.mark.parametrize("name", ["format", "version", "robot", "joint_names", "q_rad", "t_s"])
def test_a_missing_field_is_refused(path: Path, name: str) -> None:
    content = json.loads(path.read_text())
    del content[name]
    path.write_text(json.dumps(content))
    with pytest.raises(ArtefactError, match=name):
        read_taught(path, ROBOT)


@pytest.mark.parametrize("content", [b"", b"garbage", b"[]", b"7", b"\xff\xfe", b"[" * 100_000])
def test_garbage_is_refused_by_name(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "bad.json").write_bytes(content)
    with pytest.raises(ArtefactError, match=r"bad\.json"):
        read_taught(tmp_path / "bad.json", ROBOT)


def test_a_torn_file_and_a_missing_one_are_refused(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-20])
    for wrong, code in ((path, "torn_motion"), (path.with_name("no.json"), "missing_motion")):
        with pytest.raises(ArtefactError) as caught:
            read_taught(wrong, ROBOT)
        assert caught.value.code == code and str(wrong) in caught.value.message


def test_what_could_not_be_read_back_is_not_written(tmp_path: Path) -> None:
    with pytest.raises(ArtefactError, match="t_s"):
        write_taught(tmp_path / "x.json", TaughtMotion(MOTION.t_s[::-1], MOTION.q_rad), ROBOT)
    assert list(tmp_path.iterdir()) == []


def test_a_measured_joint_a_rounding_beyond_its_limit_is_put_back_on_it(path: Path) -> None:
    path.write_text(json.dumps(json.loads(path.read_text()) | {"q_rad": rows(1, 0, float(ROBOT.position_max_rad[0]) + 1e-4)}))
    assert read_taught(path, ROBOT).q_rad[1, 0] == ROBOT.position_max_rad[0]
