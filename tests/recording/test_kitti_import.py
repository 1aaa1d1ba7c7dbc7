"""Import of a KITTI folder: what is wrong with it is said in one sentence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lpet_sim.errors import RecordingError
from lpet_sim.recording.kitti import KittiSpec, import_kitti


def make_folder(root: Path, images: int = 3, depth: str = "L") -> Path:
    """Write a tiny sequence that moves forward by 1 m an image."""
    for eye in ("left", "right"):
        (root / eye).mkdir()
        for k in range(images):
            Image.new(depth, (20, 10), k).save(root / eye / f"{k:06d}.png")
    np.savetxt(root / "K.txt", [[700.0, 0, 9.5], [0, 700.0, 4.5], [0, 0, 1]])
    np.savetxt(root / "times.txt", 5.0 + 0.1 * np.arange(images))
    poses = [np.column_stack([np.eye(3), [0, 0, k]]).ravel() for k in range(images)]
    np.savetxt(root / "poses.txt", poses)
    return root


def test_a_sequence_becomes_a_recording_in_the_bodys_axes(tmp_path: Path) -> None:
    """Camera z is body x, and images come from their files one by one."""
    read = import_kitti(make_folder(tmp_path), KittiSpec(baseline_m=0.4))
    assert read.truth is not None
    assert read.measurements.images is not None
    assert read.measurements.calibration.stereo is not None
    np.testing.assert_allclose(read.truth.body.T_world_body.translation[-1], [2, 0, 0], atol=1e-12)
    np.testing.assert_allclose(read.truth.body.v_world_body_mps[1], [10, 0, 0], atol=1e-6)
    assert read.measurements.images.pair(2)[1].max() == 2
    assert read.measurements.images.t_ns.tolist() == [0, 100_000_000, 200_000_000]
    assert read.measurements.calibration.stereo.baseline_m == 0.4
    assert read.measurements.calibration.stereo.width_px == 20


@pytest.mark.parametrize("name", ["K.txt", "times.txt", "poses.txt"])
def test_a_folder_that_lacks_a_file_is_named_with_what_is_expected(
    tmp_path: Path, name: str
) -> None:
    """The sentence names what is missing and what a sequence holds."""
    (make_folder(tmp_path) / name).unlink()
    with pytest.raises(RecordingError, match=rf"lacks {name}; expected are left/"):
        import_kitti(tmp_path)


def test_a_folder_that_does_not_exist_is_refused(tmp_path: Path) -> None:
    """It lacks everything."""
    with pytest.raises(RecordingError, match="is no KITTI sequence"):
        import_kitti(tmp_path / "nowhere")


def test_counts_that_differ_are_refused(tmp_path: Path) -> None:
    """Three images need three times."""
    np.savetxt(make_folder(tmp_path) / "times.txt", [0.0, 0.1])
    with pytest.raises(RecordingError, match="3 image pairs but 2 times"):
        import_kitti(tmp_path)


def test_eyes_with_different_files_are_refused(tmp_path: Path) -> None:
    """Each left image needs its right one."""
    (make_folder(tmp_path) / "right" / "000001.png").unlink()
    with pytest.raises(RecordingError, match="of the same names"):
        import_kitti(tmp_path)


def test_files_that_are_not_what_they_say_are_refused(tmp_path: Path) -> None:
    """Text that is no numbers, and a file that is no image."""
    make_folder(tmp_path)
    (tmp_path / "left" / "000000.png").write_text("no image")
    with pytest.raises(RecordingError, match="a grey PNG is expected"):
        import_kitti(tmp_path)
    (tmp_path / "poses.txt").write_text("one two three")
    with pytest.raises(RecordingError, match="12 numbers a row"):
        import_kitti(tmp_path)


def test_colour_images_are_refused(tmp_path: Path) -> None:
    """Stereo here is grey."""
    with pytest.raises(RecordingError, match="a grey PNG with 2 is expected"):
        import_kitti(make_folder(tmp_path, depth="RGB"))


def test_an_empty_sequence_is_refused(tmp_path: Path) -> None:
    """No images, no recording."""
    with pytest.raises(RecordingError, match="0 image pairs"):
        import_kitti(make_folder(tmp_path, images=0))
