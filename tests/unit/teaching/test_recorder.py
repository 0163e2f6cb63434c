"""What the recorder makes of a stream of joint states."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from clients.demonstrations import DEMONSTRATIONS, waypoints_of
from clients.recorder import Recorder
from common.errors import ConfigError, RequestError
from common.wire.messages import RobotState


def states(values: list[float], *, id: str = "", mode: str = "tracking", start: int = 0, epoch: int = 1) -> Iterator[RobotState]:
    for k, value in enumerate(values):
        q = np.full(2, value)
        yield RobotState(
            stamp_ns=(start + k) * 8_000_000, epoch=epoch, seq=k, q_rad=q, dq_rad_s=q, q_reference_rad=q, mode=mode, reason="why",
            trajectory_id=id, trajectory_time_s=0.0, trajectory_accepted_ns=0,
        )  # type: ignore[arg-type]  # fmt: skip


def test_a_guided_motion_is_recorded_from_its_beginning_to_its_end() -> None:
    recorder = Recorder("guide-1")
    recorder.hear(states([5.0, 5.5], id="before"))
    recorder.hear(states([0.0, 0.1, 0.2], id="guide-1", start=10))
    assert not recorder.is_over
    recorder.hear(states([0.3, 0.9], id="guide-1", mode="idle", start=13))
    assert recorder.is_over and recorder.reason == "why"
    motion = recorder.motion("x")
    np.testing.assert_allclose(motion.q_rad[:, 0], [0.0, 0.1, 0.2, 0.3])
    np.testing.assert_allclose(motion.t_s, [0.0, 0.008, 0.016, 0.024])
    assert motion.label == "x"


def test_rests_before_and_after_are_left_out() -> None:
    recorder = Recorder()
    recorder.hear(states([0.0, 0.0, 0.0, 0.1, 0.1, 0.2, 0.2, 0.2]))
    motion = recorder.motion("")
    np.testing.assert_allclose(motion.q_rad[:, 0], [0.0, 0.1, 0.1, 0.2])
    assert motion.t_s[0] == 0.0


def test_a_state_that_is_not_newer_is_left_out() -> None:
    recorder = Recorder()
    recorder.hear(states([0.0, 0.1]))
    recorder.hear(states([7.0], start=1))
    recorder.hear(states([0.2], start=2))
    assert recorder.motion("").q_rad[:, 0].tolist() == [0.0, 0.1, 0.2]


def test_an_arm_that_does_not_move_is_no_motion() -> None:
    for values in ([], [1.0], [1.0, 1.0]):
        recorder = Recorder()
        recorder.hear(states(values))
        with pytest.raises(RequestError, match="did not move"):
            recorder.motion("")


def test_a_robot_that_starts_anew_ends_the_recording() -> None:
    recorder = Recorder()
    recorder.hear(states([0.0]))
    with pytest.raises(RequestError, match="started anew"):
        recorder.hear(states([0.0], epoch=2))


def test_paths_come_by_name_or_from_a_file(tmp_path) -> None:
    assert waypoints_of("over") == DEMONSTRATIONS["over"]
    (tmp_path / "way.json").write_text('[{"position_m": [0.1, 0.2, 0.3], "rest_s": 1.0}]')
    assert waypoints_of(str(tmp_path / "way.json"))[0].rest_s == 1.0
    (tmp_path / "bad.json").write_text('[{"position_m": "x"}]')
    for wrong, words in (("nobody", "over, round"), (str(tmp_path / "bad.json"), "position_m")):
        with pytest.raises(ConfigError, match=words):
            waypoints_of(wrong)
