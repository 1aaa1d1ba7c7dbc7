"""The command that checks a rover: good ones, wrong names, and ones that are not good to drive."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lpet_sim.sweep.rover_check import RoverCheck
from lpet_sim.sweep.rover_check import check_rover as check
from tests.command import Lpet, runner
from tests.rover.own_models import changed


@pytest.fixture
def lpet(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Lpet:
    """Run ``lpet`` in this process."""
    return runner(monkeypatch, capsys)


@pytest.fixture(scope="module")
def checked(tmp_path_factory: pytest.TempPathFactory) -> tuple[RoverCheck, Path]:
    """Check the four-wheel rover once."""
    picture = tmp_path_factory.mktemp("check") / "rover.png"
    return check("prospector", picture), picture


def test_the_four_wheel_rover_is_good_to_drive(checked: tuple[RoverCheck, Path]) -> None:
    """It carries its weight, stays where it is parked, and drives two metres straight."""
    found = checked[0]
    assert found.problems == ()
    assert found.load_n.sum() == pytest.approx(430 * 1.62, rel=0.02)
    assert found.crept_m < 1e-3
    assert found.driven_m == pytest.approx(2.0, abs=0.02)
    assert abs(found.aside_m) < 0.01
    assert found.ending.kind == "goal"
    assert found.clearance_m == pytest.approx(0.51)


def test_the_picture_shows_a_rover_on_the_ground(checked: tuple[RoverCheck, Path]) -> None:
    """Sky above, soil below, and between them the light grey of its wheels and mast."""
    image = np.asarray(Image.open(checked[1]), dtype=float)
    assert image.shape == (800, 1280, 3)
    sky, soil, middle = image[:60], image[-60:], image[100:700, 380:900]
    assert sky.std() < 30 < soil.std()
    grey = np.ptp(middle, axis=-1) < 15
    assert grey.mean() > 0.03


def test_a_wrong_name_ends_with_2_and_the_valid_ones(lpet: Lpet, tmp_path: Path) -> None:
    """One sentence, no traceback, and no picture; the same for a rover that there is not."""
    path = changed(tmp_path, "scout", imu={"link": "gyro"})
    ended = lpet("check-rover", path, "--out", tmp_path / "no.png")
    assert ended.code == 2
    assert ended.err.startswith("lpet: unknown link of imu 'gyro': choose one of base_link, camera")
    assert ended.err.count("\n") == 1
    assert not (tmp_path / "no.png").exists()
    assert "exomars, prospector, scout" in lpet("check-rover", "curiosity").err


def test_a_rover_that_is_not_good_to_drive_ends_with_1(lpet: Lpet, tmp_path: Path) -> None:
    """With its mass behind the rear axle the front wheels carry nothing; the picture is there."""
    path = changed(tmp_path, "scout")
    urdf = (tmp_path / "scout.urdf").read_text()
    moved = urdf.replace('<origin xyz="0 0 0"/><mass value="29"/>', _BEHIND)
    assert moved != urdf
    (tmp_path / "scout.urdf").write_text(moved)
    ended = lpet("check-rover", path, "--out", tmp_path / "bad.png")
    assert ended.code == 1
    assert "not good: wheel front_" in ended.out
    assert "of an equal share of the weight at rest" in ended.out
    assert "good to drive" not in ended.out
    assert (tmp_path / "bad.png").exists()


_BEHIND = '<origin xyz="-0.28 0 0"/><mass value="29"/>'
