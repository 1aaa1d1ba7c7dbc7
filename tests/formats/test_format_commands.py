"""``lpet export`` and ``lpet import``: what goes out comes back, and bad input is one sentence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from estimators import build_estimator
from lpet_sim.datasets import DataError, data_path
from lpet_sim.recording.kitti import import_kitti
from lpet_sim.recording.reader import read_measurements, read_recording
from lpet_sim.recording.recording import Recording
from lpet_sim.recording.streams import ImagesInMemory, Measurements
from lpet_sim.recording.truth import BodyTruth, Truth
from lpet_sim.recording.writer import write_recording
from lpet_sim.sweep.sighting import sight_recording
from lpet_sim.vision.spec import FrontEndSpec
from tests.command import Lpet, runner
from tests.formats.samples import assert_same_images, small

PAIRS = 3


@pytest.fixture
def lpet(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Lpet:
    """Run the command in this process."""
    return runner(monkeypatch, capsys)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record a traverse with every stream; not to be changed."""
    path = tmp_path_factory.mktemp("recorded") / "run.rrd"
    write_recording(path, small())
    return path


@pytest.mark.parametrize("name", ["euroc", "kitti", "tum", "mcap", "parquet"])
def test_what_is_exported_is_imported_again(
    name: str, lpet: Lpet, recorded: Path, tmp_path: Path
) -> None:
    """By the same name, to a recording that reads; the files that were written are named."""
    out, back = tmp_path / "out", tmp_path / "back.rrd"
    ended = lpet("export", name, recorded, out)
    assert ended.code == 0, ended.err
    assert f"wrote {out}" in ended.out
    source = out / "truth.txt" if name == "tum" else out
    ended = lpet("import", name, source, back)
    assert ended.code == 0, ended.err
    read, given = read_recording(back), small()
    assert read.truth is not None
    assert (read.measurements.images is not None) == (name != "tum")
    if name != "tum":
        assert_same_images(read.measurements.images, given.measurements.images)


def test_calibration_is_exported_for_kalibr(lpet: Lpet, recorded: Path, tmp_path: Path) -> None:
    """Two files."""
    assert lpet("export", "kalibr", recorded, tmp_path / "out").code == 0
    assert len(list((tmp_path / "out").iterdir())) == 2


@pytest.mark.parametrize("name", ["euroc", "kitti", "tum", "mcap", "parquet"])
def test_bad_input_ends_in_one_sentence(
    name: str, lpet: Lpet, recorded: Path, tmp_path: Path
) -> None:
    """A recording, or data, that is not there; a folder that holds something."""
    gone = tmp_path / "gone"
    full = tmp_path / "full"
    full.mkdir()
    (full / "mine").write_text("")
    for arguments, named in (
        (("export", name, gone, tmp_path / "out"), gone),
        (("import", name, gone, tmp_path / "out.rrd"), gone),
        (("export", name, recorded, full), full),
    ):
        ended = lpet(*arguments)
        assert ended.code == 2
        assert len(ended.err.splitlines()) == 1
        assert str(named) in ended.err
    assert [path.name for path in sorted(tmp_path.rglob("*"))] == ["full", "mine"]


def test_a_calibration_is_taken_from_yaml(lpet: Lpet, recorded: Path, tmp_path: Path) -> None:
    """And a word that is none of its keys is refused."""
    assert lpet("export", "mcap", recorded, tmp_path / "bag").code == 0
    declared = tmp_path / "declared.yaml"
    declared.write_text("gravity_mps2: 1.62\n")
    back = tmp_path / "back.rrd"
    assert lpet("import", "mcap", tmp_path / "bag", back, "--calibration", declared).code == 0
    calibration = read_measurements(back).calibration
    assert calibration.gravity_mps2 == 1.62
    assert calibration.stereo == small().measurements.calibration.stereo
    declared.write_text("gravity: 1.62\n")
    ended = lpet("import", "mcap", tmp_path / "bag", back, "--calibration", declared)
    assert ended.code == 2
    assert "unknown key 'gravity'" in ended.err


@pytest.fixture(scope="module")
def real(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record the first pairs of a real sequence, or skip where it is not there."""
    try:
        whole = import_kitti(data_path("stereo/kitti00_first100"))
    except DataError as error:
        pytest.skip(str(error))
    images, truth = whole.measurements.images, whole.truth
    assert images is not None
    assert truth is not None
    pairs = [images.pair(k) for k in range(PAIRS)]
    left, right = (np.stack(eye) for eye in zip(*pairs, strict=True))
    few = ImagesInMemory(images.t_ns[:PAIRS].copy(), left, right)
    body = BodyTruth.from_poses(images.t_ns[:PAIRS].copy(), truth.body.T_world_body[:PAIRS])
    path = tmp_path_factory.mktemp("real") / "real.rrd"
    given = Measurements(whole.measurements.calibration, images=few)
    write_recording(path, Recording(whole.manifest, given, Truth(body)))
    return path


@pytest.fixture(scope="module")
def sighted(real: Path) -> Measurements:
    """Run the front end on the sequence itself."""
    sight_recording(real, real.with_name("sighted.rrd"), FrontEndSpec())
    return read_measurements(real.with_name("sighted.rrd"))


@pytest.mark.parametrize("name", ["euroc", "kitti", "mcap"])
def test_front_end_and_estimator_run_unchanged_on_what_was_imported(
    name: str, lpet: Lpet, real: Path, sighted: Measurements, tmp_path: Path
) -> None:
    """``lpet sight`` on real pairs by way of each format gives the sightings of the original."""
    back = tmp_path / "back.rrd"
    assert lpet("export", name, real, tmp_path / "out").code == 0
    assert lpet("import", name, tmp_path / "out", back).code == 0
    assert lpet("sight", back).code == 0
    here, there = sighted, read_measurements(back)
    assert here.sightings is not None
    assert there.sightings is not None
    assert there.sightings.equals(here.sightings)
    assert len(here.sightings.landmark_id) > 100 * PAIRS
    poses = [build_estimator("frame_to_frame").estimate(m).trajectory for m in (here, there)]
    moved = [p.T_world_body.translation[-1] for p in poses]
    # KITTI's way keeps the baseline to its last digit but one.
    np.testing.assert_allclose(moved[1], moved[0], atol=0.0 if name != "kitti" else 1e-9)
    assert np.linalg.norm(moved[0]) > 1.0


def test_other_commands_see_what_was_imported(lpet: Lpet, recorded: Path, tmp_path: Path) -> None:
    """Estimates of an imported recording are scored, and exported beside its truth."""
    back = tmp_path / "back.rrd"
    assert lpet("export", "euroc", recorded, tmp_path / "out").code == 0
    assert lpet("import", "euroc", tmp_path / "out", back).code == 0
    assert lpet("estimate", back, "--estimator", "dead_reckoning").code == 0
    assert lpet("evaluate", back).code == 0
    assert lpet("export", "tum", back, tmp_path / "tum").code == 0
    rows = np.loadtxt(tmp_path / "tum" / "dead_reckoning.txt")
    assert len(rows) > 10


def test_an_import_that_breaks_off_leaves_no_recording(
    lpet: Lpet, recorded: Path, tmp_path: Path
) -> None:
    """An image in the middle that is none, or in colour, is named."""
    assert lpet("export", "euroc", recorded, tmp_path / "out").code == 0
    image = sorted((tmp_path / "out/mav0/cam1/data").glob("*.png"))[4]
    for spoil in (lambda: image.write_text("no image"), lambda: _colour().save(image)):
        spoil()
        ended = lpet("import", "euroc", tmp_path / "out", tmp_path / "back.rrd")
        assert ended.code == 2
        assert str(image) in ended.err
        assert "a grey PNG" in ended.err
        assert [path.name for path in tmp_path.iterdir()] == ["out"]


def _colour() -> Image.Image:
    return Image.new("RGB", (64, 48))
