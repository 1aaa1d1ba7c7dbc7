"""A drive with other sensors: what they would have measured, without driving it again."""

from __future__ import annotations

from dataclasses import dataclass

from lpet_sim.errors import RecordingError
from lpet_sim.progress import Progress, silent
from lpet_sim.recording.calibration import Calibration
from lpet_sim.recording.recording import Recording
from lpet_sim.recording.streams import ImuStream, Measurements, WheelStream
from lpet_sim.recording.truth import Truth
from lpet_sim.rng import stream
from lpet_sim.sensors.imu import Imu
from lpet_sim.sensors.landmark_sensor import sense_landmarks
from lpet_sim.sensors.landmark_spec import LandmarkSensorSpec
from lpet_sim.sensors.suite import SensorSuiteSpec
from lpet_sim.sensors.wheels import WheelEncoders
from lpet_sim.terrain.terrain import Terrain


@dataclass(frozen=True, eq=False)
class Carrier:
    """A recorded drive that can carry other sensors.

    Attributes:
        truth: What really happened.
        calibration: What was declared on the drive: where unit and wheels are.
        terrain: What it was driven on.
    """

    truth: Truth
    calibration: Calibration
    terrain: Terrain

    @classmethod
    def of(cls, recording: Recording, terrain: Terrain) -> Carrier:
        """Take what is needed of a simulated recording.

        Raises:
            RecordingError: It holds no truth, or declares no inertial unit or wheels.
        """
        truth, calibration = recording.truth, recording.measurements.calibration
        if truth is None or truth.wheels is None:
            raise RecordingError("the recording holds no truth; give a simulated traverse")
        if calibration.imu is None or calibration.wheels is None:
            raise RecordingError(
                "the recording declares no inertial unit or no wheels; give one that does"
            )
        return cls(truth, calibration, terrain)

    def carry(
        self,
        suite: SensorSuiteSpec,
        landmarks: LandmarkSensorSpec,
        seed: int,
        progress: Progress = silent,
    ) -> Measurements:
        """Give what other sensors would have measured on the same drive.

        Inertial unit and wheels stay where they are and keep their rates; errors, camera and
        landmarks are drawn anew from the seed.

        Args:
            suite: The sensors; its camera must have a mount.
            landmarks: The landmark-level sensor that stands for the camera.
            seed: Of all draws; the terrain keeps its own.
            progress: Called after each image.

        Raises:
            RecordingError: The suite lacks a sensor, or the camera a mount.
        """
        if suite.stereo is None or suite.imu is None or suite.wheels is None:
            raise RecordingError("the suite lacks a sensor: it needs imu, wheels and stereo")
        if suite.stereo.mount is None:
            raise RecordingError("sensors.stereo needs a mount: say where the left eye is")
        stereo = suite.stereo.declared_calibration(suite.stereo.mount.se3())
        imu, wheels = self._imu(suite, seed), self._wheels(suite, seed)
        seen = sense_landmarks(self.truth.body, self.terrain, stereo, landmarks, seed, progress)
        declared = self._declared(suite).model_copy(update={"stereo": stereo})
        return Measurements(declared, imu=imu, wheels=wheels, sightings=seen)

    def _imu(self, suite: SensorSuiteSpec, seed: int) -> ImuStream:
        assert suite.imu is not None and self.calibration.imu is not None
        mount = self.calibration.imu.T_body_imu.se3()
        rng = stream(seed, "carried", "imu")
        return Imu(suite.imu, mount, self.calibration.gravity_mps2, rng).sense(self.truth.body)

    def _wheels(self, suite: SensorSuiteSpec, seed: int) -> WheelStream:
        assert suite.wheels is not None and self.calibration.wheels is not None
        assert self.truth.wheels is not None
        rng = stream(seed, "carried", "wheels")
        count = len(self.calibration.wheels.names)
        return WheelEncoders(suite.wheels, count, rng).sense(self.truth.wheels)

    def _declared(self, suite: SensorSuiteSpec) -> Calibration:
        """Declare the noises of the suite, and the places of the recording."""
        assert suite.imu is not None and suite.wheels is not None
        imu, wheels = self.calibration.imu, self.calibration.wheels
        assert imu is not None and wheels is not None
        sigmas = {
            "scale_sigma": suite.wheels.declared_scale_sigma,
            "white_sigma_m_rtm": suite.wheels.declared_white_m_rtm,
            "lateral_sigma_m_rtm": suite.wheels.declared_lateral_m_rtm,
            "heading_sigma_rad_rtm": suite.wheels.declared_heading_rad_rtm,
        }
        return self.calibration.model_copy(
            update={
                "imu": suite.imu.declared(imu.T_body_imu.se3(), imu.rate_hz),
                "wheels": wheels.model_copy(update=sigmas),
            }
        )
