"""The check of estimators: ours pass it, and one that is off does not."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from lpet_sim.errors import SpecError
from lpet_sim.recording.recording import Recording
from lpet_sim.sweep import conformance
from lpet_sim.sweep.conformance import check_estimator
from tests.command import Lpet, runner
from tests.plugins.examples import straight


@pytest.fixture(scope="module", autouse=True)
def driven_once() -> Iterator[None]:
    """Drive once for all estimators that need no images."""
    held: list[Recording] = []
    drive = conformance._perfect_drive

    def once(with_images: bool, progress: object) -> Recording:
        assert not with_images
        if not held:
            held.append(drive(False, lambda share: None))
        return held[0]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(conformance, "_perfect_drive", once)
        yield


@pytest.mark.parametrize("name", ["dead_reckoning", "fused_odometry", "frame_to_frame", "slam"])
def test_estimators_of_our_own_pass(name: str) -> None:
    """Each of them, in everything that is looked at."""
    assert [f for f in check_estimator(name, {}) if f.passed is False] == []


def test_an_estimator_that_turns_where_the_rover_does_not_is_told_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The example drives straight on: it misses the bend, and nothing else."""
    straight(monkeypatch)
    found = check_estimator("straight:Straight", {})
    assert [f.what for f in found if f.passed is False] == ["has no error without noise and slip"]
    assert [f.what for f in found if f.passed is None] == ["has covariances that are some"]


def test_an_estimator_that_gives_nothing_is_told_so() -> None:
    """By the kind of its failure."""
    wrong = {"how": "covariance", "memory_limit_mib": 1000}
    found = check_estimator("tests.plugins.wrongdoers:Wrong", wrong)
    assert found[-1].passed is False
    assert found[-1].text.startswith("bad_covariance: the covariance of pose 7")


def test_a_stream_that_there_is_not_is_told_in_a_sentence() -> None:
    """Streams are named by what there is."""
    with pytest.raises(SpecError, match="there are the streams imu, wheels, odometry, sightings"):
        check_estimator("program", {"command": ["true"], "needs": ["lidar"]})


def test_the_command_says_what_an_estimator_does_not_do(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 1 where it fails, 2 where it is none."""
    straight(monkeypatch)
    lpet: Lpet = runner(monkeypatch, capsys)
    ended = lpet("check-estimator", "straight:Straight")
    assert ended.code == 1 and "has no error without noise and slip" in ended.out
    ended = lpet("check-estimator", "nowhere:Thing")
    assert ended.code == 2 and "there is no module 'nowhere'" in ended.err
