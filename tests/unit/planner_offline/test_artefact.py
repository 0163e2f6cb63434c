from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from common.errors import ArtefactError
from services.planner.offline import artefact
from services.planner.offline.artefact import Artefact

PRINTS = {"robot": "aaaa", "grid": "bbbb"}


def sample() -> Artefact:
    arrays = {
        "weights": np.linspace(0, 1, 12).reshape(4, 3),
        "edges": np.array([[0, 1], [1, 2]], dtype=np.int32),
        "owners": np.arange(7, dtype=np.uint16),
        "none": np.empty((0, 2), dtype=np.int64),
        "number": np.array(3.5),
    }
    return Artefact(arrays, PRINTS, {"neurons": 4})


def test_what_is_written_is_read(tmp_path: Path) -> None:
    path = tmp_path / "new" / "a.tolman"
    artefact.write(path, sample())
    kept = artefact.read(path, PRINTS)
    assert kept.figures == {"neurons": 4} and kept.fingerprints == PRINTS
    assert set(kept.arrays) == set(sample().arrays)
    for name, array in sample().arrays.items():
        assert kept.arrays[name].dtype == array.dtype and kept.arrays[name].shape == array.shape
        np.testing.assert_array_equal(kept.arrays[name], array)
        assert kept.arrays[name].flags.writeable and kept.arrays[name].flags.c_contiguous


def test_equal_content_is_equal_bytes_whatever_the_order(tmp_path: Path) -> None:
    one, two = sample(), sample()
    turned = Artefact({name: np.array(two.arrays[name], order="F") for name in reversed(list(two.arrays))}, PRINTS, two.figures)
    assert artefact.write(tmp_path / "1", one) == artefact.write(tmp_path / "2", turned)
    assert (tmp_path / "1").read_bytes() == (tmp_path / "2").read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["1", "2"], "something was left behind"


@pytest.mark.parametrize("what", ["robot", "grid"])
def test_a_foreign_file_is_refused_by_name(tmp_path: Path, what: str) -> None:
    artefact.write(tmp_path / "a", sample())
    with pytest.raises(ArtefactError, match=what) as caught:
        artefact.read(tmp_path / "a", {**PRINTS, what: "cccc"})
    assert caught.value.code == "foreign_artefact"
    assert caught.value.facts == {"path": str(tmp_path / "a"), "what": what, "found": PRINTS[what], "expected": "cccc"}


def test_a_missing_file_and_another_version_are_told_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ArtefactError) as missing:
        artefact.read(tmp_path / "none", PRINTS)
    assert missing.value.code == "missing_artefact"
    artefact.write(tmp_path / "a", sample())
    monkeypatch.setattr(artefact, "VERSION", 99)
    with pytest.raises(ArtefactError, match="99") as other:
        artefact.read(tmp_path / "a", PRINTS)
    assert other.value.code == "artefact_version"


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_no_damage_goes_unnoticed(tmp_path: Path, data: st.DataObject) -> None:
    path = tmp_path / "a"
    artefact.write(path, sample())
    whole = path.read_bytes()
    at = data.draw(st.integers(0, len(whole) - 1))
    if data.draw(st.booleans()):
        torn = whole[:at]
    else:
        torn = bytearray(whole)
        torn[at] ^= 1 << data.draw(st.integers(0, 7))
    path.write_bytes(bytes(torn))
    try:
        kept = artefact.read(path, PRINTS)
    except ArtefactError as error:
        assert error.code in ("torn_artefact", "artefact_version", "foreign_artefact")
        assert str(path) in error.message
    else:
        raise AssertionError(f"byte {at} of {len(whole)} changed and nobody noticed: {kept}")


def test_objects_are_not_kept(tmp_path: Path) -> None:
    with pytest.raises(ArtefactError, match="things"):
        artefact.write(tmp_path / "a", Artefact({"things": np.array([{}], dtype=object)}, PRINTS))
    assert not (tmp_path / "a").exists()
