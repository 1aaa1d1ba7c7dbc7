"""Streams are checked once, when they are made, and cannot be changed afterwards."""

import dataclasses

import numpy as np
import pytest

from lpet_sim.errors import RecordingError
from lpet_sim.geometry import SE3
from lpet_sim.recording.calibration import Calibration
from lpet_sim.recording.columns import put_together, take_apart
from lpet_sim.recording.streams import (
    ImuStream,
    Measurements,
    SightingStream,
    WheelStream,
    concatenate_slices,
)
from lpet_sim.recording.trajectory import Trajectory


def _sightings(**changed: np.ndarray) -> SightingStream:
    fields = {
        "t_ns": np.array([0, 10, 20]),
        "offsets": np.array([0, 2, 2, 3]),
        "landmark_id": np.array([4, 7, 4]),
        "stereo_px": np.zeros((3, 3)),
        "sigma_px": np.ones(3),
    }
    return SightingStream(**(fields | changed))


def test_rows_that_do_not_match_the_times_are_refused_by_name() -> None:
    """The sentence names the stream, the array and both lengths."""
    with pytest.raises(RecordingError, match=r"ImuStream\.accel_mps2 has 3 rows but t_ns has 4"):
        ImuStream(np.arange(4), np.zeros((4, 3)), np.zeros((3, 3)))
    with pytest.raises(RecordingError, match=r"Trajectory\.T_world_body has 2 rows"):
        Trajectory(np.arange(3), SE3.identity(2))


def test_times_must_increase_strictly() -> None:
    """Neither back nor twice the same."""
    for t_ns in ([0, 2, 1], [0, 1, 1]):
        with pytest.raises(RecordingError, match="increase"):
            WheelStream(np.array(t_ns), np.zeros((3, 6)), np.zeros((3, 6)))


def test_a_landmark_twice_in_an_image_and_numbers_that_are_none_are_refused() -> None:
    """Before an estimator trips over them; the same landmark in two images is what is wanted."""
    assert len(_sightings()) == 3
    with pytest.raises(RecordingError, match="landmark 4 is seen twice in the image at 0 ns"):
        _sightings(landmark_id=np.array([4, 4, 4]))
    for name, value in (("stereo_px", np.full((3, 3), np.nan)), ("sigma_px", np.zeros(3))):
        with pytest.raises(RecordingError, match="must be finite, and sigma_px above zero"):
            _sightings(**{name: value})


def test_arrays_of_a_stream_are_read_only() -> None:
    """Neither the arrays nor the fields can be set."""
    imu = ImuStream(np.arange(2), np.zeros((2, 3)), np.zeros((2, 3)))
    with pytest.raises(ValueError, match="read-only"):
        imu.gyro_radps[0] = 1.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        imu.t_ns = np.arange(3)  # type: ignore[misc]


def test_equality_is_to_the_bit() -> None:
    """A last bit, a type or a sign of zero makes the difference."""

    def imu(gyro: np.ndarray) -> ImuStream:
        return ImuStream(np.arange(2), gyro, np.zeros((2, 3)))

    one = imu(np.ones((2, 3)))
    assert one.equals(imu(np.ones((2, 3))))
    assert not one.equals(imu(np.nextafter(np.ones((2, 3)), 2)))
    assert not one.equals(imu(np.ones((2, 3), dtype=np.float32)))
    assert not imu(np.zeros((2, 3))).equals(imu(-np.zeros((2, 3))))


def test_sightings_of_an_image_are_its_rows() -> None:
    """An image may see nothing."""
    sightings = _sightings()
    assert [sightings.landmark_id[sightings.rows(i)].tolist() for i in range(3)] == [
        [4, 7],
        [],
        [4],
    ]


@pytest.mark.parametrize(
    "changed",
    [
        {"offsets": np.array([0, 2, 3])},
        {"offsets": np.array([1, 2, 2, 3])},
        {"offsets": np.array([0, 2, 2, 4])},
        {"offsets": np.array([0, 3, 2, 3])},
        {"landmark_id": np.array([4, 7])},
        {"stereo_px": np.zeros((2, 3))},
        {"sigma_px": np.ones(4)},
    ],
)
def test_offsets_that_do_not_fit_the_rows_are_refused(changed: dict[str, np.ndarray]) -> None:
    """Too few, not from zero, not to the end, falling, or any one array of another length."""
    with pytest.raises(RecordingError, match="offsets"):
        _sightings(**changed)


def test_offsets_are_made_from_the_ids_of_each_image() -> None:
    """No image gives the offset of zero rows."""
    parts = [np.array([4, 7]), np.array([], dtype=np.int64), np.array([4])]
    assert concatenate_slices(parts).tolist() == [0, 2, 2, 3]
    assert concatenate_slices([]).tolist() == [0]


def test_a_stream_that_is_absent_is_named_with_those_that_are_there() -> None:
    """And a recording that was never sighted says what to run."""
    wheels = WheelStream(np.arange(2), np.zeros((2, 6)), np.zeros((2, 6)))
    measurements = Measurements(Calibration(), wheels=wheels)
    measurements.require("wheels")
    with pytest.raises(RecordingError, match=r"no stream 'imu' \(it has: wheels\)$"):
        measurements.require("wheels", "imu")
    with pytest.raises(RecordingError, match=r"it has: none\); run .lpet sense. first$"):
        Measurements(Calibration()).require("sightings")


def test_a_declared_drift_survives_the_columns_and_recordings_without_one_say_zero() -> None:
    """Recordings made before tracks could be declared to slide stay readable."""
    seen = _sightings(drift_px=np.array([0.1, 0.2, 0.3]))
    columns = {f"seen/{name}": column for name, column in take_apart(seen)}
    again = put_together(SightingStream, "seen", columns)
    assert again is not None and again.equals(seen)
    del columns["seen/drift_px"]
    older = put_together(SightingStream, "seen", columns)
    assert older is not None and older.drift_px.tolist() == [0.0, 0.0, 0.0]
