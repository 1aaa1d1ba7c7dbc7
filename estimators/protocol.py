"""What every estimator is: measurements in, an estimate out, and never the truth."""

from __future__ import annotations

from typing import Protocol

from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.streams import Measurements


class Estimator(Protocol):
    """Anything that turns measurements into a trajectory."""

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of the streams that it cannot do without, such as ``wheels``."""
        ...

    @property
    def name(self) -> str:
        """The name under which results are reported."""
        ...

    def estimate(self, measurements: Measurements) -> Estimate:
        """Estimate the traverse from its measurements alone.

        Args:
            measurements: Streams and declared calibration of one recording.

        Returns:
            Poses in the world, with covariance where the estimator gives one.

        Raises:
            RecordingError: The recording lacks a stream that the estimator needs.
        """
        ...
