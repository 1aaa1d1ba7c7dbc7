"""The names of an ASL folder: those that all know, and our own beside them.

What ASL has no place for lies in folders whose names begin with ``lpet_``; other readers pass over
them. Everything an estimator may know is in ``mav0``; the truth is in the folders of `TRUTH`, which
`write_measurements` leaves out.
"""

from __future__ import annotations

from lpet_sim.geometry import SE3
from lpet_sim.recording.calibration import Calibration, PoseSpec, WheelCalibration
from lpet_sim.spec import Spec

ROOT = "mav0"
EYES = ("cam0", "cam1")
IMU = "imu0"
BODY_TRUTH = "state_groundtruth_estimate0"

ABOUT = "lpet.yaml"
WHEELS = "lpet_wheels0"
ODOMETRY = "lpet_odometry0"
SIGHTINGS = "lpet_sightings0"
OWN_TRUTH = "lpet_truth0"
TRUTH = (BODY_TRUTH, OWN_TRUTH)
"""The folders that an estimator must not see."""

DATA, SENSOR = "data.csv", "sensor.yaml"
SIGHTED_IMAGES = "images.csv"
BODY_RATE, WHEEL_TRUTH = "body_rate.csv", "wheels.csv"
EVENTS, MANIFEST = "events.json", "manifest.json"

STAMP = "timestamp [ns]"
NAMES = (STAMP, "filename")
IMU_COLUMNS = (
    STAMP,
    *(f"w_RS_S_{axis} [rad s^-1]" for axis in "xyz"),
    *(f"a_RS_S_{axis} [m s^-2]" for axis in "xyz"),
)
BODY_COLUMNS = (
    STAMP,
    *(f"p_RS_R_{axis} [m]" for axis in "xyz"),
    *(f"q_RS_{axis} []" for axis in "wxyz"),
    *(f"v_RS_R_{axis} [m s^-1]" for axis in "xyz"),
    *(f"b_w_RS_S_{axis} [rad s^-1]" for axis in "xyz"),
    *(f"b_a_RS_S_{axis} [m s^-2]" for axis in "xyz"),
)
SIGHTING_COLUMNS = (STAMP, "landmark_id", "u_left_px", "u_right_px", "v_px", "sigma_px")
IMAGE_COLUMNS = (STAMP, "drift_px")


class AboutSpec(Spec):
    """What belongs to no sensor.

    Attributes:
        start_stamp_ns: The stamp of the recording's start [ns].
        gravity_mps2: Magnitude of gravity, along -z of the world [m/s^2].
        T_world_body_start: The pose at the start, which is given.
    """

    start_stamp_ns: int
    gravity_mps2: float
    T_world_body_start: PoseSpec

    @classmethod
    def of(cls, calibration: Calibration, start_stamp_ns: int) -> AboutSpec:
        """Take what belongs to no sensor out of a calibration."""
        return cls(
            start_stamp_ns=start_stamp_ns,
            gravity_mps2=calibration.gravity_mps2,
            T_world_body_start=calibration.T_world_body_start,
        )


def image_name(stamp_ns: int) -> str:
    """Name the file of an image."""
    return f"{stamp_ns}.png"


def wheel_mapping(wheels: WheelCalibration) -> dict[str, object]:
    """Give the file of the encoders, which stand in the body."""
    identity = {"cols": 4, "rows": 4, "data": SE3.identity().matrix().ravel().tolist()}
    return {"sensor_type": "wheel_encoders", "T_BS": identity, "lpet": wheels.to_mapping()}
