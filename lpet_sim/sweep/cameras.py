"""Image pairs along a drive: rendered here, worked on beside, collected in order."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from lpet_sim.errors import SpecError
from lpet_sim.recording.arrays import NS_PER_S
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.recording.streams import SightingStream
from lpet_sim.recording.truth import BodyTruth
from lpet_sim.rng import stream
from lpet_sim.sensors.camera import StereoRenderer
from lpet_sim.sensors.camera_spec import StereoCameraSpec
from lpet_sim.sensors.image_chain import expose
from lpet_sim.sweep.traverse import ImagesSpec
from lpet_sim.vision.front_end import FrontEnd

_PAIRS_IN_FLIGHT = 3


@dataclass(frozen=True)
class TakenPair:
    """An image pair with what the front end saw in it.

    Attributes:
        t_ns: When it was taken since the start [ns].
        left: Left image, Shape (h, w).
        right: Right image.
        sightings: What was seen, None without a front end.
    """

    t_ns: int
    left: NDArray[Any]
    right: NDArray[Any]
    sightings: SightingStream | None


class StereoPipeline:
    """Takes image pairs of a moving body.

    Rendering stays in the caller's thread, which holds the OpenGL context; image chain and front
    end run in a second thread, one pair after another, so that both cores have work.
    """

    def __init__(
        self,
        spec: ImagesSpec,
        renderer: StereoRenderer,
        camera: StereoCameraSpec,
        calibration: StereoCalibration,
        seed: int,
    ) -> None:
        """Set up the pipeline.

        Args:
            spec: When images are taken and how they are sighted.
            renderer: Renders what the eyes see; closed with the pipeline.
            camera: The pair as it truly is, with its image chain.
            calibration: The declared pair, for the front end.
            seed: The run's seed.
        """
        self._period_ns = round(spec.period_s * NS_PER_S)
        self._renderer, self._camera, self._seed = renderer, camera, seed
        self._front_end = FrontEnd(spec.front_end, calibration) if spec.front_end else None
        self._worker = ThreadPoolExecutor(max_workers=1)
        self._pending: deque[Future[TakenPair]] = deque()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Drop what is under way and free the renderer."""
        self._worker.shutdown(cancel_futures=True)
        self._renderer.close()

    def take(self, body: BodyTruth) -> Iterator[TakenPair]:
        """Take the pairs that fall into a piece of truth; yield those that are done.

        Raises:
            SpecError: The period is not a multiple of the truth's.
        """
        for row in np.flatnonzero(body.t_ns % self._period_ns == 0):
            t_ns = int(body.t_ns[row])
            radiance = self._renderer.render(body.T_world_body[row])
            self._pending.append(self._worker.submit(self._work, t_ns, *radiance))
            while len(self._pending) >= _PAIRS_IN_FLIGHT:
                yield self._pending.popleft().result()

    def rest(self) -> Iterator[TakenPair]:
        """Yield the pairs still under way."""
        while self._pending:
            yield self._pending.popleft().result()

    def _work(
        self, t_ns: int, left_radiance: NDArray[Any], right_radiance: NDArray[Any]
    ) -> TakenPair:
        rng = stream(self._seed, "traverse", "camera", t_ns)
        chain, focal_px = self._camera.chain, self._camera.focal_px
        left = expose(left_radiance, chain, focal_px, rng)
        right = expose(right_radiance, chain, focal_px, rng)
        if self._front_end is None:
            return TakenPair(t_ns, left, right, None)
        seen = self._front_end.track(left, right)
        sightings = SightingStream(
            np.array([t_ns]),
            np.array([0, len(seen.landmark_id)]),
            seen.landmark_id,
            seen.stereo_px,
            seen.sigma_px,
            np.array([self._front_end.drift_px]),
        )
        return TakenPair(t_ns, left, right, sightings)


def check_period(spec: ImagesSpec, imu_rate_hz: float) -> None:
    """Hold the time between pairs to be a whole number of samples of the truth.

    Raises:
        SpecError: It is not.
    """
    samples = spec.period_s * imu_rate_hz
    if samples < 1 or abs(samples - round(samples)) > 1e-9 * samples:
        raise SpecError(
            f"images.period_s {spec.period_s:g} must be a multiple of 1/imu_rate_hz = "
            f"{1 / imu_rate_hz:g} s, such as {max(1, round(samples)) / imu_rate_hz:g}"
        )
